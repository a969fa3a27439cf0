/* SPDX-License-Identifier: MIT */
/* hal/stage.h -- the translation stage that carries the array.  Backend by URI:
 *   sim:?speed=0.2&acceleration=0.5&settle=0.15&error=0.0001     (m/s, m/s2, s, m)
 *   sim:?pace=fast      moves take no time
 *   none:               a fixed array
 *   gpiod:CHIP?step=LINE&...    a step-and-direction driver on GPIO lines
 *   zaber:TTY?pitch_mm=...      a Zaber stage on a serial line
 * The real ones lose their place with every fault: each move is refused until it is
 * homed. */
#ifndef ANLOS_HAL_STAGE_H
#define ANLOS_HAL_STAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/clock.h"
#include "hal/device.h"

enum { STAGE_TEXT_SIZE = 160 };

enum stage_motion { STAGE_IDLE, STAGE_MOVING, STAGE_SETTLING, STAGE_FAULT };

struct stage_status {
    enum stage_motion motion;
    double position_m;
    int64_t at_ns; /* when it was there */
    double target_m;
    double reach_m[2];          /* the ends of where it may be sent */
    bool homed;                 /* its place is known */
    char text[STAGE_TEXT_SIZE]; /* of a fault */
    char note[STAGE_TEXT_SIZE]; /* what a person should know though it works; or empty */
};

struct stage_ops {
    const char *scheme;
    int (*open)(void **state, const char *arg, const struct clock_source *clock,
                struct error *why);
    /* As stage_move_at; both are finite, speed_m_s from 0: its own. */
    int (*move)(void *state, double target_m, double speed_m_s);
    int (*home)(void *state);
    int (*stop)(void *state);
    /* *out comes idle, homed, without text, at 0 and as of now. */
    void (*status)(void *state, struct stage_status *out);
    /* May be NULL: nothing is counted. */
    size_t (*counts)(void *state, struct device_count out[DEVICE_MAX_COUNTS]);
    void (*close)(void *state);
};

/* The tables that stage_open chooses from. */
extern const struct stage_ops stage_gpiod_ops;
extern const struct stage_ops stage_zaber_ops;
extern const struct stage_ops stage_sim_ops;

struct stage;

/* 0, -EINVAL, -ENOENT, -ENODEV (no such scheme), -ENOMEM. */
int stage_open(struct stage **out, const char *uri, const struct clock_source *clock,
               struct error *why);

/* Starts a move and returns; a move under way is replaced.  0, -ERANGE (soft limits),
 * -ESTALE (its place is lost: home it). */
int stage_move(struct stage *s, double target_m);

/* The same at a speed of its own: between its ramps it goes at speed_m_s all the way.
 * 0, as stage_move, -EDOM (it does not go so fast, or moves without taking time). */
int stage_move_at(struct stage *s, double target_m, double speed_m_s);

/* Starts to look for its place, which also ends a fault.  0, -errno. */
int stage_home(struct stage *s);

/* Brakes to rest; the place stays known, but for a homing that is broken off.  0, -errno.
 */
int stage_stop(struct stage *s);
void stage_status(struct stage *s, struct stage_status *out);

/* Why a move was refused, in words: with -ERANGE how far it goes. */
void stage_refusal(const struct stage_status *s, int err, char text[STAGE_TEXT_SIZE]);

/* How many counts there are. */
size_t stage_counts(struct stage *s, struct device_count out[DEVICE_MAX_COUNTS]);
void stage_close(struct stage *s);

#endif
