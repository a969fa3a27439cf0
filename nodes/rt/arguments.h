/* SPDX-License-Identifier: MIT */
/* nodes/rt/arguments.h -- the command line that all nodes and `anlos launch` share. */
#ifndef ANLOS_NODES_RT_ARGUMENTS_H
#define ANLOS_NODES_RT_ARGUMENTS_H

#include <stdbool.h>

#include "dsp/error.h"
#include "nodes/rt/choice.h"
#include "nodes/rt/log.h"

struct arguments { /* borrow from argv */
    const char *launch;
    const char *run_dir;    /* NULL: the default */
    const char *out;        /* NULL: as the launch file says */
    const char *record;     /* a bag to be recorded; NULL: as the launch file says */
    const char *snapshot;   /* folder of bags of the last seconds; NULL: the same */
    const char *bag, *rate; /* of the node play; NULL: as the launch file says */
    const char *host;       /* which of the launch file's hosts this is; NULL: not said */
    bool realtime;
    bool unsupervised; /* nodes that hang are left alone: for a debugger */
    bool replay;       /* it lives in a replay, though the launch file has no node play */
    bool help, version;
    choice_names *values; /* in place of the help: what an option may be; or NULL */
    enum log_level log_level;
    enum log_format log_format;
};

/* Reads `[FILE] --launch FILE --run-dir DIR --out DIR --record BAG --snapshot DIR
 * --bag FILE --rate R --host NAME --realtime --replay --no-supervision --log-level LEVEL
 * --log-format FORM
 * --version --help[=OPTION]`.  0, or -EINVAL: unknown option, missing or wrong value, no
 * launch file. */
int arguments_parse(struct arguments *out, int argc, char **argv, struct error *why);

/* The options' help, for the end of a program's own. */
const char *arguments_help(void);

#endif
