/* SPDX-License-Identifier: MIT */
/* hal/stage/worker.h -- the thread of a stage that takes its time: it homes and moves
 * while others ask for the state.  The newest command counts and breaks off the one under
 * way.  After a fault the place is lost: every move is refused until it is homed. */
#ifndef ANLOS_HAL_STAGE_WORKER_H
#define ANLOS_HAL_STAGE_WORKER_H

#include <stdbool.h>

#include "hal/stage.h"

/* All run in the worker's thread.  0, -ECANCELED (a newer command; the stage is at rest),
 * another negative errno: a fault, with why in text. */
struct stage_worker_ops {
    int (*home)(void *device, char text[STAGE_TEXT_SIZE]);
    /* speed_m_s 0: its own */
    int (*move)(void *device, double target_m, double speed_m_s,
                char text[STAGE_TEXT_SIZE]);
    int (*stop)(void *device, char text[STAGE_TEXT_SIZE]); /* what still moves; or NULL */
    /* At rest: returns at once when wake_fd is readable, else after a while. */
    int (*rest)(void *device, int wake_fd, char text[STAGE_TEXT_SIZE]);
};

struct stage_worker_config {
    double settle_s;
    bool homed; /* it knows its place already */
    bool
        home_first; /* a move homes first where the place is not known and was not lost */
    bool realtime;  /* its thread must not be late (hal/realtime.h) */
    double position_m;
};

struct stage_worker;

/* The device is driven from the thread alone, but for what its ops guard themselves.
 * 0, -errno. */
int stage_worker_create(struct stage_worker **out, const struct stage_worker_config *cfg,
                        const struct stage_worker_ops *ops, void *device,
                        const struct clock_source *clock, struct error *why);

/* As stage_move_at, stage_home, stage_stop, stage_status; the range is the caller's. */
int stage_worker_move(struct stage_worker *w, double target_m, double speed_m_s);
int stage_worker_home(struct stage_worker *w);
int stage_worker_stop(struct stage_worker *w);
void stage_worker_status(struct stage_worker *w, struct stage_status *out);

/* For the ops: is there a newer command; a descriptor that is readable then; where the
 * stage is, now or at at_ns by the clock; and what a person should know though it works.
 */
bool stage_worker_cancelled(const struct stage_worker *w);
int stage_worker_wake_fd(const struct stage_worker *w);
void stage_worker_at(struct stage_worker *w, double position_m);
void stage_worker_was_at(struct stage_worker *w, double position_m, int64_t at_ns);
void stage_worker_note(struct stage_worker *w, const char *note);

/* Breaks off what is under way and waits for the thread. */
void stage_worker_destroy(struct stage_worker *w);

#endif
