/* nodes/anlos/bag/record_job.h -- the work of `anlos bag record`. */
#ifndef ANLOS_NODES_ANLOS_BAG_RECORD_JOB_H
#define ANLOS_NODES_ANLOS_BAG_RECORD_JOB_H

#include <stdbool.h>

#include "msgs/bag/compression.h"
#include "dsp/complaint.h"
#include "nodes/anlos/bag/verb.h"

struct record_options {
    const char *out;
    char *topics;                       /* patterns */
    const char *exclude;                /* patterns, or NULL */
    char exclude_room[VERB_PATTERNS];   /* where they may lie */
    const char *run_dir;                /* NULL: the default */
    const char *launch;                 /* launch file to be attached, or NULL */
    double split_mb, split_s, quota_mb; /* 0: none */
    double flush_ms;
    double duration_s; /* INFINITY: until Ctrl-C */
    enum bag_compression compression;
};

/* Until Ctrl-C or the end of the duration; shows how it goes and what came of it.
 * *began: there is a bag.  0, 1 (messages got lost), negative errno. */
int record_run(const struct record_options *o, bool *began, struct complaint *why);

#endif
