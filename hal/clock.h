/* SPDX-License-Identifier: MIT */
/* hal/clock.h -- the only source of time.  Nodes ask it and never read a clock
 * themselves, so that a replay can hold its own time. */
#ifndef ANLOS_HAL_CLOCK_H
#define ANLOS_HAL_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

#include "dsp/error.h"

struct clock_source {
    int64_t (*now_ns)(void *state); /* wall time, ns since 1970 */
    /* Returns 0 when it is t_ns, -EINTR when the sleep was broken off. */
    int (*sleep_until_ns)(void *state, int64_t t_ns);
    void *state;
};

/* The machine's clock: counts on CLOCK_MONOTONIC, offset to wall time once at the start,
 * so that it never jumps.  Whose parent has shared its clock takes the parent's offset.
 */
const struct clock_source *clock_system(void);

/* CLOCK_MONOTONIC, for deadlines and rates of one process: no time of the system's. */
int64_t clock_monotonic_ns(void);

/* The processes that this one starts from now on count as it does, whatever becomes of
 * the wall clock in between: ANLOS_CLOCK in their environment, "PID:NS" with the process
 * whose children it is for, so that it means nothing to others or on another machine.
 * 0 or a negative errno. */
int clock_share(void);

/* -EINVAL: what the parent shared is damaged; this process took an offset of its own. */
int clock_check_shared(struct error *why);

/* How far the wall clock is ahead of clock_system by now: it was set since the start. */
int64_t clock_wall_ahead_ns(void);

/* Does the wall clock follow another one (NTP, PTP), as the kernel knows it? */
bool clock_is_synchronised(void);

static inline int64_t clock_now_ns(const struct clock_source *c)
{
    return c->now_ns(c->state);
}

/* Time as a replay has it: it stands still between messages, and each one that is
 * replayed moves it to its own stamp, also backwards.  So results are dated by what they
 * are made of and not by when the machine came to it: same bag in, same bytes out.  What
 * waits for something else waits by the machine's clock. */
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
