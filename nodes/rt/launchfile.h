/* SPDX-License-Identifier: MIT */
/* nodes/rt/launchfile.h -- a launch file: which nodes run and with what. */
#ifndef ANLOS_NODES_RT_LAUNCHFILE_H
#define ANLOS_NODES_RT_LAUNCHFILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/cfar.h"
#include "dsp/error.h"
#include "msgs/bag/compression.h"
#include "msgs/hosts.h"
#include "recon/frontend/compressor.h"
#include "recon/frontend/frontend.h"
#include "recon/imaging/imager_options.h"
#include "recon/static_array/frames.h"
#include "recon/tracking/object_tracker.h"
#include "recon/walls/wall_map.h"

#define SNAPSHOT_BEFORE_S 30 /* of record.snapshot: defaults, */
#define SNAPSHOT_AFTER_S  5
#define SNAPSHOT_MAX_MB   512
#define SNAPSHOT_MOST_S   3600 /* and bounds: of before and after, */
#define SNAPSHOT_LEAST_MB 16   /* and of megabytes */
#define SNAPSHOT_MOST_MB  65536

struct launch_track { /* recon/tracking/track.h tells what they do, and why so much */
    double threshold_db;
    double min_existence; /* of a detection */
    enum cfar_kind cfar;  /* in place of threshold_db; default ordered for a fixed array,
                           * off for scans */
    double false_alarm_rate; /* of each voxel, with cfar; default 1e-4 */
    enum object_tracker_mode mode;
    unsigned confirm_hits, confirm_of;
    double confirm_existence;
    double detection_probability;
    double clutter;     /* false detections in an image */
    double sidelobe_db; /* recon/tracking/sidelobes.h */
    double look_s;      /* recon/tracking/timing.h */
    double acceleration_psd, join_m, coast_s;
};

/* Input paths in URIs are relative to the launch file's folder, the report's folder to
 * the current one, and a log of CAN frames to the report's folder.  What is loaded has
 * them resolved. */
struct launchfile {
    char *path;
    char **nodes; /* names, in the order of starting */
    unsigned n_nodes;
    struct {
        char *uri;       /* hal/array.h */
        double person_m; /* recon/frontend/range_monitor.h: what a person's echo is
                            taken for */
    } array;
    struct {
        char *uri; /* hal/stage.h; default "sim:" */
    } stage;
    struct {
        bool fixed;      /* mode: the array stands and fires without end; */
        bool continuous; /* or its stage does not stop, which array.uri says too; else */
                         /* stepped, unless the array's file says otherwise */
        uint32_t *speakers;         /* [n_speakers] of a fixed array, in this order */
        size_t n_speakers;          /* 0: all */
        unsigned background_frames; /* of a fixed array */
        bool background;            /* record a pass without the objects first */
        unsigned window;            /* pings that may be under way without a receipt */
        unsigned retries;           /* of one ping */
        double timeout_s; /* after the last sign of life, a ping counts as lost */
    } scan;
    struct {
        enum window window;           /* default hann */
        enum compression compression; /* default matched_filter */
        enum background_mode background;
        double background_s; /* that an adaptive one is the mean of */
    } dsp;
    struct {
        char *method;
        unsigned threads; /* 0: as many as processors may be used */
        struct imager_options options;
        bool preview;       /* a volume after each stage position, time permitting */
        struct {            /* of scan.mode fixed */
            unsigned pings; /* the newest, in an image; 0: those of a frame, default */
            enum frames_sum sum; /* default power */
            bool every_ping;     /* an image; default: every frame */
        } frames;
    } recon;
    struct launch_track track;
    struct {
        char *uri;        /* hal/canbus.h; default "log:can.candump" */
        unsigned base_id; /* default 0x400; a sensor adds 0x10 times its number */
        unsigned sensor;
        bool fd;                        /* one FD frame an object */
        bool motion;                    /* and its motion frame */
        bool field_of_view;             /* and the list's field of view */
        unsigned bitrate, data_bitrate; /* default 500000 and 2000000 bit/s */
        double load;                    /* share of the bus to use at most; default 0.5 */
        struct { /* nodes/can/uds.h; identifiers above 0x7ff have 29 bits */
            uint32_t request, response; /* 0: nobody is answered, default */
            uint32_t functional;        /* to all servers; 0: not heard, default */
        } diagnosis;
    } can;
    struct {
        enum wall_from from; /* default survey */
        bool vertical;       /* prior: vertical, the default; else none */
        double vertical_deg; /* default 2: how upright walls are, one sigma */
        double reach_m;      /* default 5: how far away walls are looked for */
        double every_s;      /* default 0.5: from estimate to estimate */
        double lost_s;       /* default 3: without being seen or given */
        unsigned n_corners;  /* of what the array sees directly; default 0 */
        double free_view_m[WALLS_MAX_CORNERS][2]; /* x, z in the array's plane */
    } wall;
    struct {
        char *folder; /* what the report node writes into; default "out" */
    } report;
    struct {
        char *path;             /* of the bag; relative to the current folder; or empty */
        char *topics, *exclude; /* patterns with commas between; default "*" and "" */
        unsigned split_mb, split_s, quota_mb; /* 0: none */
        enum bag_compression compression;     /* default none */
        bool shuffle;                         /* msgs/shuffle.h; default no */
        unsigned flush_ms;                    /* default 1000 */
        struct {
            char *folder; /* of bags of the last seconds; NULL: none are kept */
            unsigned before_s, after_s, max_mb; /* nodes/record/snapshot.h */
            bool faults;                        /* a new one is saved; default */
        } snapshot;
    } record;
    struct {
        char *bag;   /* empty: there is no node play */
        double rate; /* of the recording's pace; 0: max */
        bool loop;
        double start_s, end_s; /* after its first message; INFINITY: to the end */
        char *topics, *exclude, *remap; /* NULL: the default (nodes/play/playback.h) */
    } play;
    struct {
        char *address; /* default 127.0.0.1 */
        unsigned port; /* default 8765 */
        char *bag;     /* NULL: the running system is shown */
        bool save;     /* the page may ask a recorder for the last seconds */
    } view;
    struct {
        enum realtime_mode { REALTIME_AUTO, REALTIME_OFF, REALTIME_REQUIRED } realtime;
        double alive_s; /* a node whose loop stands still for so long is started again;
                           default 3; 0: never */
    } processes;
    struct hosts hosts; /* none: all on this machine (nodes/rt/launchfile_hosts.h) */
};

struct launchfile_options { /* of the command line, they win over the file */
    const char *out;        /* report.folder, or NULL */
    const char *record;     /* record.path, and there is such a node; or NULL */
    const char *snapshot;   /* record.snapshot.folder, the same */
    const char *bag, *rate; /* play.bag and play.rate, or NULL */
    bool realtime;          /* simulated hardware runs at the true pace */
};

bool launchfile_has_node(const struct launchfile *l, const char *name);

/* Is there a stage that the scan has to move?  A recording was moved when it was made;
 * a stage that happens to be there must stand still while it is played. */
bool launchfile_moves_stage(const struct launchfile *l);

/* Does an array that stands set the pace, by its sound?  What is replayed, or simulated
 * as fast as it goes, does not. */
bool launchfile_keeps_pace(const struct launchfile *l);

/* Defaults are filled in.  options may be NULL.
 * 0, -ENOENT, -EINVAL ("file:line: key: expected"), -ENOMEM. */
int launchfile_load(struct launchfile **out, const char *path,
                    const struct launchfile_options *options, struct error *why);

/* The same of a text in memory, data[size]; path: what it is called. */
int launchfile_parse(struct launchfile **out, const char *path, const void *data,
                     size_t size, struct error *why);
void launchfile_destroy(struct launchfile *l);

/* "2", "0.5", or "max": 0.  0, -EINVAL. */
int launchfile_play_rate(const char *text, double *out);

#endif
