/* SPDX-License-Identifier: MIT */
/* hal/stage/stepper_axis.h -- a stepper on a rail: metres, homing, soft limits, backlash,
 * and whether its place is known.  Homing: fast to the switch, off it, slowly back to it,
 * and off it by back_off_m; there the axis stands at the end of its range. */
#ifndef ANLOS_HAL_STAGE_STEPPER_AXIS_H
#define ANLOS_HAL_STAGE_STEPPER_AXIS_H

#include "hal/stage/gpio.h"
#include "hal/stage/stepper.h"

enum { STEPPER_AXIS_TEXT_SIZE = 128 };

struct stepper_axis_config {
    double steps_per_m;
    double speed_m_s, home_speed_m_s;
    double min_m, max_m;
    double back_off_m;
    double backlash_m;  /* under back_off_m; taken up by arriving away from home */
    bool has_home;      /* else homing says that it stands at the end of its range now */
    bool home_positive; /* the home switch is at max_m, else at min_m */
};

struct stepper_axis {
    struct stepper_axis_config cfg;
    struct stepper stepper;
    bool homed; /* its place is known */
    bool taut;  /* the backlash is taken up */
    int64_t home_steps;
    _Atomic uint64_t homings, limit_hits, estops;
    char text[STEPPER_AXIS_TEXT_SIZE]; /* why the last command failed */
};

void stepper_axis_init(struct stepper_axis *a, const struct stepper_axis_config *cfg,
                       const struct stepper_config *stepper, const struct stepper_io *io);

double stepper_axis_position_m(const struct stepper_axis *a);

/* Both block until the axis is at rest.  0, -ECANCELED (braked, place known), or: place
 * lost, text says why: -EIO (a limit, no home switch found), -ESHUTDOWN (emergency stop),
 * another negative errno (the lines).  move: -ERANGE, -ESTALE (place not known);
 * speed_m_s 0: the axis' own. */
int stepper_axis_home(struct stepper_axis *a);
int stepper_axis_move(struct stepper_axis *a, double target_m, double speed_m_s);

/* At rest: looks at the switches.  0, or as above. */
int stepper_axis_watch(struct stepper_axis *a);

/* A stepper's lines on a GPIO chip, and its clock: CLOCK_MONOTONIC, by absolute timers.
 */

struct stepper_gpio {
    struct gpio *gpio; /* lines as enum stepper_line has them; not owned */
    void *owner;
    bool (*cancelled)(void *owner); /* also the place to say where the stage is */
};

/* The functions take g as their state: it has to live as long as they are used. */
struct stepper_io stepper_gpio_io(struct stepper_gpio *g);

/* At rest: until an input changes or wake_fd is readable, or for a second. */
void stepper_gpio_rest(struct stepper_gpio *g, int wake_fd);

#endif
