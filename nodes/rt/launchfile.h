/* nodes/rt/launchfile.h -- a launch file: which nodes run and with what. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_H
#define ANLOS_NODES_RT_LAUNCHFILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/complaint.h"
#include "nodes/rt/compressor.h"
#include "recon/imager_options.h"

/* Input paths in URIs are relative to the launch file's folder, the report's folder to
 * the current one, and a log of CAN frames to the report's folder.  What is loaded has
 * them resolved. */
struct launchfile {
    char *path;
    char **nodes; /* names, in the order of starting */
    unsigned n_nodes;
    struct {
        char *uri; /* hal/array.h */
    } array;
    struct {
        char *uri; /* hal/stage.h; default "sim:" */
    } stage;
    struct {
        bool background;  /* record a pass without the objects first */
        unsigned window;  /* pings that may be under way without a receipt */
        unsigned retries; /* of one ping */
        double timeout_s; /* after the last sign of life, a ping counts as lost */
    } scan;
    struct {
        enum window window;           /* default hann */
        enum compression compression; /* default matched_filter */
    } dsp;
    struct {
        char *method;
        unsigned threads; /* 0: all cores */
        struct imager_options options;
        bool preview; /* a volume after each stage position, time permitting */
    } recon;
    struct {
        double threshold_db;
        double min_existence;
    } track;
    struct {
        char *uri; /* hal/canbus.h; default "log:can.candump" */
        unsigned base_id;
    } can;
    struct {
        char *folder; /* what the report node writes into; default "out" */
    } report;
};

struct launchfile_options { /* of the command line, they win over the file */
    const char *out;        /* report.folder, or NULL */
    bool realtime;          /* simulated hardware runs at the true pace */
};

bool launchfile_has_node(const struct launchfile *l, const char *name);

/* Is there a stage that the scan has to move?  A recording was moved when it was made;
 * a stage that happens to be there must stand still while it is played. */
bool launchfile_moves_stage(const struct launchfile *l);

/* Defaults are filled in.  options may be NULL.
 * 0, -ENOENT, -EINVAL ("file:line: key: expected"), -ENOMEM. */
int launchfile_load(struct launchfile **out, const char *path,
                    const struct launchfile_options *options, struct complaint *why);
void launchfile_destroy(struct launchfile *l);

#endif
