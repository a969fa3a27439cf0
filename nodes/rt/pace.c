/* SPDX-License-Identifier: MIT */
#include "nodes/rt/pace.h"

bool pace_is_late(struct pace *p, int64_t now_ns)
{
    uint64_t done = p->done - p->then_done, skipped = p->skipped - p->then_skipped;

    if (now_ns < p->due_ns)
        return p->late;
    p->due_ns = now_ns + PACE_LOOK_NS;
    p->then_done = p->done;
    p->then_skipped = p->skipped;
    p->late = (double)skipped > PACE_LATE * (double)(done + skipped);
    return p->late;
}
