/* SPDX-License-Identifier: MIT */
/* hal/turn.h -- whose turn it is in a shot (hal/array.h): emission after emission, and of
 * an endless or continuous one round after round; and for what was recorded before, the
 * pace at which it would be recorded. */
#ifndef ANLOS_HAL_TURN_H
#define ANLOS_HAL_TURN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/array.h"
#include "hal/clock.h"
#include "recon/survey.h"

struct turn {
    size_t n_speakers; /* of the shot */
    bool endless, continuous;
    size_t next;      /* emission of the round */
    size_t round;     /* from 0 */
    bool paced;       /* each has a time of its own */
    int64_t start_ns; /* then of the first */
};

void turn_start(struct turn *t, const struct array_shot *shot, int64_t now_ns);
void turn_advance(struct turn *t);

/* The slot of the next emission, counted through all rounds; and to go on at another. */
size_t turn_slot(const struct turn *t, const struct survey *s);
void turn_go(struct turn *t, const struct survey *s, size_t slot);

/* The round, from 1, of an endless or continuous shot; else 0. */
uint32_t turn_frame(const struct turn *t);

/* Of an endless shot, or a continuous one whose stage goes on (start_ns): waits until
 * n_ping samples of the next emission would be recorded.  *t0_ns: when the first one is,
 * or now.  0, -EINTR. */
int turn_wait(const struct turn *t, const struct survey *s, size_t n_ping,
              const struct clock_source *clock, int64_t *t0_ns, struct error *why);

#endif
