/* SPDX-License-Identifier: MIT */
/* tests/hal/rail.h -- a rail with a motor that does as its step and direction lines say,
 * two limit switches, an emergency stop, and a clock that only moves when it is slept on.
 * The stage client lags behind the motor by the play of its drive. */
#ifndef ANLOS_TESTS_HAL_RAIL_H
#define ANLOS_TESTS_HAL_RAIL_H

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#include "hal/stage/stepper.h"

enum { RAIL_MAX_STEPS = 200000 };

struct rail {
    int64_t now_ns;
    int64_t motor, stage_client, play; /* steps */
    bool step, forward, enabled;
    bool moved_disabled;
    int64_t home_at, limit_at; /* closed from there on, of the stage client */
    bool home_positive;        /* the home switch is at the upper end */
    uint64_t estop_after;      /* steps made; 0: never */
    uint64_t blip_after;       /* an emergency stop that is over at once */
    uint64_t cancel_after;
    uint64_t fail_after; /* the lines fail */
    unsigned bounce;     /* of the home switch: so many reads after it has opened */
    int64_t (*late_ns)(struct rail *r); /* how late sleeps end; NULL: on time */
    uint64_t seed;
    uint64_t n; /* steps made */
    int64_t times_ns[RAIL_MAX_STEPS];
    int64_t direction_ns, pulse_ns, low_ns;
    int64_t shortest_pulse_ns, shortest_low_ns, shortest_setup_ns;
    bool was_home, blipped;
};

static inline int64_t rail_now(void *state)
{
    return ((struct rail *)state)->now_ns;
}

static inline void rail_sleep(void *state, int64_t t_ns)
{
    struct rail *r = state;
    if (t_ns > r->now_ns)
        r->now_ns = t_ns;
    if (r->late_ns)
        r->now_ns += r->late_ns(r);
}

static inline void rail_move(struct rail *r)
{
    r->motor += r->forward ? 1 : -1;
    if (r->stage_client < r->motor - r->play)
        r->stage_client = r->motor - r->play;
    if (r->stage_client > r->motor)
        r->stage_client = r->motor;
    r->moved_disabled |= !r->enabled;
    if (r->now_ns - r->direction_ns < r->shortest_setup_ns)
        r->shortest_setup_ns = r->now_ns - r->direction_ns;
    r->pulse_ns = r->now_ns;
    if (r->now_ns - r->low_ns < r->shortest_low_ns)
        r->shortest_low_ns = r->now_ns - r->low_ns;
    if (r->n < RAIL_MAX_STEPS)
        r->times_ns[r->n] = r->now_ns;
    r->n++;
}

static inline int rail_set(void *state, enum stepper_line line, bool active)
{
    struct rail *r = state;
    if (r->fail_after && r->n >= r->fail_after)
        return -5; /* EIO */
    if (line == STEPPER_ENABLE)
        r->enabled = active;
    if (line == STEPPER_DIRECTION) {
        r->forward = active;
        r->direction_ns = r->now_ns;
    }
    if (line == STEPPER_STEP && active && !r->step)
        rail_move(r);
    if (line == STEPPER_STEP && !active && r->step &&
        r->now_ns - r->pulse_ns < r->shortest_pulse_ns)
        r->shortest_pulse_ns = r->now_ns - r->pulse_ns;
    if (line == STEPPER_STEP && !active && r->step)
        r->low_ns = r->now_ns;
    if (line == STEPPER_STEP)
        r->step = active;
    return 0;
}

static inline int rail_inputs(void *state, unsigned *active)
{
    struct rail *r = state;
    bool home = r->home_positive ? r->stage_client >= r->home_at
                                 : r->stage_client <= r->home_at;
    bool limit = r->home_positive ? r->stage_client <= r->limit_at
                                  : r->stage_client >= r->limit_at;
    bool blip = r->blip_after && r->n >= r->blip_after && !r->blipped;
    if (r->was_home && !home && r->bounce) {
        r->bounce--;
        home = true;
    } else {
        r->was_home = home;
    }
    r->blipped |= blip;
    *active = (home ? STEPPER_BIT(STEPPER_HOME) : 0) |
              (limit ? STEPPER_BIT(STEPPER_LIMIT) : 0) |
              (blip || (r->estop_after && r->n >= r->estop_after)
                   ? STEPPER_BIT(STEPPER_ESTOP)
                   : 0);
    return r->fail_after && r->n >= r->fail_after ? -5 : 0;
}

static inline bool rail_cancelled(void *state)
{
    struct rail *r = state;
    return r->cancel_after && r->n >= r->cancel_after;
}

/* A rail whose switches are far away. */
static inline struct rail *rail_create(void)
{
    struct rail *r = calloc(1, sizeof *r);
    if (!r)
        abort();
    r->home_at = INT64_MIN;
    r->limit_at = INT64_MAX;
    r->shortest_pulse_ns = r->shortest_low_ns = r->shortest_setup_ns = INT64_MAX;
    r->direction_ns = r->low_ns = INT64_MIN / 2;
    return r;
}

static inline struct stepper_io rail_io(struct rail *r)
{
    return (struct stepper_io){r,        rail_now,    rail_sleep,    rail_sleep,
                               rail_set, rail_inputs, rail_cancelled};
}

#endif
