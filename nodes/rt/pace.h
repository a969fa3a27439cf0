/* SPDX-License-Identifier: MIT */
/* nodes/rt/pace.h -- does a node keep up?  Whoever is late leaves some of its work out,
 * counts it, and says so when that is more than a moment's load. */
#ifndef ANLOS_NODES_RT_PACE_H
#define ANLOS_NODES_RT_PACE_H

#include <stdbool.h>
#include <stdint.h>

#define PACE_LOOK_NS                                                                     \
    INT64_C(1000000000) /* from one look at what was skipped to the next */
#define PACE_LATE 0.1   /* share skipped since the last look: late */

struct pace { /* {0}: nothing yet */
    uint64_t done, skipped;
    int64_t due_ns; /* of the next look */
    uint64_t then_done, then_skipped;
    bool late;
};

/* The machine's clock. */
bool pace_is_late(struct pace *p, int64_t now_ns);

#endif
