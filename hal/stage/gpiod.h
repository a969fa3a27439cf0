/* SPDX-License-Identifier: MIT */
/* hal/stage/gpiod.h -- a stage on a step-and-direction driver: GPIO lines from libgpiod,
 * a thread that makes the steps.  It is named by
 *
 *   gpiod:CHIP?step=LINE&direction=LINE&steps_per_m=80000&max=1
 *
 * Lines are offsets or names.  step, direction, steps_per_m and max are needed, the rest
 * has defaults: enable, home, limit, estop (lines), invert=estop,enable (active low),
 * pull=up, down or as-is (the switches), min, speed, acceleration, settle, backlash,
 * home_speed, home_direction=negative or positive, back_off (from the switch to the end
 * of the range), homing=first-move or manual, direction_setup_us, pulse_us.  Metres and
 * seconds. */
#ifndef ANLOS_HAL_STAGE_GPIOD_H
#define ANLOS_HAL_STAGE_GPIOD_H

#include "hal/device.h"
#include "hal/stage/gpio.h"
#include "hal/stage/stepper.h"

struct stage_gpiod_options {
    struct gpio_line lines[STEPPER_N_LINES];
    struct stepper_config stepper;
    struct stepper_axis_config axis;
    double settle_s;
    bool home_first;
};

/* All keys, ended by NULL. */
extern const char *const stage_gpiod_option_keys[];

/* The lines' names belong to the device.  0, -EINVAL. */
int stage_gpiod_options_read(struct stage_gpiod_options *out, const struct device *d,
                             struct error *why);

#endif
