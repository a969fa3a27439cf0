/* SPDX-License-Identifier: MIT */
#include "hal/stage/gpiod_options.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#define ENABLE_NS 5000000 /* until a driver that was off holds its motor */

const char *const stage_gpiod_option_keys[] = {
    "step",           "direction", "enable",   "home",
    "limit",          "estop",     "invert",   "pull",
    "steps_per_m",    "min",       "max",      "speed",
    "acceleration",   "settle",    "backlash", "home_speed",
    "home_direction", "back_off",  "homing",   "direction_setup_us",
    "pulse_us",       NULL};

static const char *const line_names[STEPPER_N_LINES] = {
    [STEPPER_STEP] = "step",     [STEPPER_DIRECTION] = "direction",
    [STEPPER_ENABLE] = "enable", [STEPPER_HOME] = "home",
    [STEPPER_LIMIT] = "limit",   [STEPPER_ESTOP] = "estop"};

static int read_lines(struct stage_gpiod_options *o, const struct device *d,
                      struct error *why)
{
    static const char *const pulls[] = {[GPIO_PULL_AS_IS] = "as-is",
                                        [GPIO_PULL_UP] = "up",
                                        [GPIO_PULL_DOWN] = "down",
                                        NULL};
    int pull = device_choice(d, "pull", pulls, why);

    if (pull < 0)
        return pull;
    for (int i = 0; i < STEPPER_N_LINES; i++) {
        o->lines[i].name = device_option(d, line_names[i]);
        o->lines[i].input = i >= STEPPER_N_OUTPUTS;
        if (o->lines[i].input)
            o->lines[i].pull = (enum gpio_pull)pull;
        if (o->lines[i].name && !*o->lines[i].name)
            return error_say(why, -EINVAL, "option %s=: expected a line", line_names[i]);
    }
    for (int i = STEPPER_STEP; i <= STEPPER_DIRECTION; i++)
        if (!o->lines[i].name)
            return error_say(why, -EINVAL,
                             "option %s is missing: the line of its %s input",
                             line_names[i], line_names[i]);
    return 0;
}

/* The lines that are active low, with commas between. */
static int read_invert(struct stage_gpiod_options *o, const struct device *d,
                       struct error *why)
{
    const char *text = device_option(d, "invert");

    while (text && *text) {
        size_t n = strcspn(text, ",");
        int i = 0;
        while (i < STEPPER_N_LINES &&
               (strlen(line_names[i]) != n || strncmp(line_names[i], text, n)))
            i++;
        if (i == STEPPER_N_LINES)
            return error_say(why, -EINVAL,
                             "option invert: \"%.*s\": expected step, direction, enable, "
                             "home, limit or estop",
                             (int)n, text);
        o->lines[i].active_low = true;
        text += n + (text[n] == ',');
    }
    return 0;
}

static int read_numbers(struct stage_gpiod_options *o, const struct device *d,
                        struct error *why)
{
    struct stepper_axis_config *a = &o->axis;
    double acceleration = 0.5, setup_us = 20, pulse_us = 5;
    struct {
        const char *key;
        double min, max, *value;
        bool needed;
    } numbers[] = {
        {"steps_per_m", 1, 1e8, &a->steps_per_m, true},
        {"max", -100, 100, &a->max_m, true},
        {"min", -100, 100, &a->min_m, false},
        {"speed", 1e-5, 10, &a->speed_m_s, false},
        {"acceleration", 1e-4, 1000, &acceleration, false},
        {"settle", 0, 60, &o->settle_s, false},
        {"backlash", 0, 0.1, &a->backlash_m, false},
        {"back_off", 1e-5, 0.5, &a->back_off_m, false},
        {"home_speed", 1e-5, 10, &a->home_speed_m_s, false},
        {"direction_setup_us", 0, 1e6, &setup_us, false},
        {"pulse_us", 0.1, 1e5, &pulse_us, false},
    };
    *a = (struct stepper_axis_config){
        .speed_m_s = 0.1, .back_off_m = 0.005, .home_speed_m_s = 0.02};
    o->settle_s = 0.15;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        if (numbers[i].needed && !device_option(d, numbers[i].key))
            return error_say(why, -EINVAL, "option %s is missing", numbers[i].key);
        int err = device_number(d, numbers[i].key, numbers[i].min, numbers[i].max,
                                numbers[i].value, why);
        if (err)
            return err;
    }
    o->stepper = (struct stepper_config){.acceleration = acceleration * a->steps_per_m,
                                         .direction_setup_ns = (int64_t)(1e3 * setup_us),
                                         .pulse_ns = (int64_t)(1e3 * pulse_us),
                                         .enable_ns = ENABLE_NS};
    return 0;
}

/* Steps faster than the pulse and its pause cannot be made. */
static int check(const struct stage_gpiod_options *o, struct error *why)
{
    const struct stepper_axis_config *a = &o->axis;
    double speed_m_s = fmax(a->speed_m_s, a->home_speed_m_s);
    double steps_s = speed_m_s * a->steps_per_m;

    if (a->min_m >= a->max_m)
        return error_say(why, -EINVAL, "option min=%g is not under max=%g", a->min_m,
                         a->max_m);
    if (a->backlash_m >= a->back_off_m)
        return error_say(why, -EINVAL,
                         "option backlash=%g: expected less than back_off=%g, so that it "
                         "is taken up when homing ends",
                         a->backlash_m, a->back_off_m);
    if (2e-9 * (double)o->stepper.pulse_ns * steps_s > 1)
        return error_say(why, -EINVAL,
                         "%g m/s need %.0f steps/s, more than pulses of %g us allow",
                         speed_m_s, steps_s, 1e-3 * (double)o->stepper.pulse_ns);
    return 0;
}

int stage_gpiod_options_read(struct stage_gpiod_options *o, const struct device *d,
                             struct error *why)
{
    static const char *const ends[] = {"negative", "positive", NULL};
    static const char *const homings[] = {"first-move", "manual", NULL};

    *o = (struct stage_gpiod_options){.home_first = true};
    int err = read_lines(o, d, why);
    if (!err)
        err = read_invert(o, d, why);
    if (!err)
        err = read_numbers(o, d, why);
    int end = err ? err : device_choice(d, "home_direction", ends, why);
    int homing = end < 0 ? end : device_choice(d, "homing", homings, why);
    if (homing < 0)
        return homing;
    o->axis.has_home = o->lines[STEPPER_HOME].name;
    o->axis.home_positive = end == 1;
    o->home_first = homing == 0 && o->axis.has_home;
    if (homing == 0 && device_option(d, "homing") && !o->axis.has_home)
        return error_say(why, -EINVAL, "option homing=first-move needs home=LINE");
    return check(o, why);
}
