/* SPDX-License-Identifier: MIT */
/* hal/clock_replay.h -- time as a replay has it: it stands still between messages, and
 * each one that is replayed moves it to its own stamp, also backwards.  So results are
 * dated by what they are made of and not by when the machine came to it: same bag in,
 * same bytes out.  What waits for something else waits by the machine's clock. */
#ifndef ANLOS_HAL_CLOCK_REPLAY_H
#define ANLOS_HAL_CLOCK_REPLAY_H

#include <stdbool.h>

#include "hal/clock.h"

struct clock_replay {
    struct clock_source
        source; /* what to hand on: now_ns is the replay's while it is on */
    const struct clock_source *machine;
    bool on;
    int64_t now_ns;
};

/* Off: the machine's time.  c must stay where it is. */
void clock_replay_init(struct clock_replay *c, const struct clock_source *machine);
void clock_replay_set(struct clock_replay *c, int64_t now_ns);
void clock_replay_end(struct clock_replay *c);

#endif
