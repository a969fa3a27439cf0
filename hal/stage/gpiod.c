/* SPDX-License-Identifier: MIT */
/* hal/stage/gpiod.c -- a stage on a step-and-direction driver: GPIO lines from libgpiod,
 * a thread that makes the steps. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hal/device.h"
#include "hal/stage/backends.h"
#include "hal/stage/gpiod_options.h"
#include "hal/stage/stepper_axis.h"
#include "hal/stage/worker.h"

struct stage_gpiod {
    struct gpio *gpio;
    struct stepper_gpio lines;
    struct stepper_axis axis;
    struct stage_worker *worker;
};

static bool gpiod_cancelled(void *owner)
{
    struct stage_gpiod *s = owner;

    stage_worker_at(s->worker, stepper_axis_position_m(&s->axis));
    return stage_worker_cancelled(s->worker);
}

/* What the axis says of itself, for the worker. */
static int say(struct stage_gpiod *s, int err, char text[STAGE_TEXT_SIZE])
{
    stage_worker_at(s->worker, stepper_axis_position_m(&s->axis));
    memcpy(text, s->axis.text, sizeof s->axis.text);
    return err;
}

static int work_home(void *state, char text[STAGE_TEXT_SIZE])
{
    struct stage_gpiod *s = state;

    return say(s, stepper_axis_home(&s->axis), text);
}

static int work_move(void *state, double target_m, double speed_m_s,
                     char text[STAGE_TEXT_SIZE])
{
    struct stage_gpiod *s = state;

    return say(s, stepper_axis_move(&s->axis, target_m, speed_m_s), text);
}

static int work_rest(void *state, int wake_fd, char text[STAGE_TEXT_SIZE])
{
    struct stage_gpiod *s = state;

    stepper_gpio_rest(&s->lines, wake_fd);
    s->axis.text[0] = '\0';
    return say(s, stepper_axis_watch(&s->axis), text);
}

static int start(struct stage_gpiod *s, const struct stage_gpiod_options *o,
                 const char *chip, const struct clock_source *clock, struct error *why)
{
    static const struct stage_worker_ops ops = {
        .home = work_home, .move = work_move, .rest = work_rest};
    const struct stage_worker_config cfg = {
        .settle_s = o->settle_s, .home_first = o->home_first, .realtime = true};
    int err = gpio_open(&s->gpio, chip, o->lines, STEPPER_N_LINES, "anlos stage", why);

    if (err)
        return err;
    s->lines =
        (struct stepper_gpio){.gpio = s->gpio, .owner = s, .cancelled = gpiod_cancelled};
    const struct stepper_io io = stepper_gpio_io(&s->lines);
    stepper_axis_init(&s->axis, &o->axis, &o->stepper, &io);
    return stage_worker_create(&s->worker, &cfg, &ops, s, clock, why);
}

static int gpiod_open(void **state, const char *arg, const struct clock_source *clock,
                      struct error *why)
{
    struct stage_gpiod_options o;
    struct device d;
    int err = device_parse(&d, arg, stage_gpiod_option_keys, why);

    if (err)
        return err;
    struct stage_gpiod *s = calloc(1, sizeof *s);
    err = s ? stage_gpiod_options_read(&o, &d, why)
            : error_say(why, -ENOMEM, "out of memory");
    if (!err)
        err = start(s, &o, d.path, clock, why);
    device_clear(&d);
    if (err && s) {
        gpio_close(s->gpio);
        free(s);
    } else {
        *state = s;
    }
    return err;
}

static int gpiod_move(void *state, double target_m, double speed_m_s)
{
    struct stage_gpiod *s = state;

    if (target_m < s->axis.cfg.min_m || target_m > s->axis.cfg.max_m)
        return -ERANGE;
    if (speed_m_s > s->axis.cfg.speed_m_s)
        return -EDOM;
    return stage_worker_move(s->worker, target_m, speed_m_s);
}

static int gpiod_home(void *state)
{
    struct stage_gpiod *s = state;

    return stage_worker_home(s->worker);
}

static int gpiod_stop(void *state)
{
    struct stage_gpiod *s = state;

    return stage_worker_stop(s->worker);
}

static void gpiod_status(void *state, struct stage_status *out)
{
    struct stage_gpiod *s = state;

    stage_worker_status(s->worker, out);
}

static size_t gpiod_counts(void *state, struct device_count out[DEVICE_MAX_COUNTS])
{
    const struct stage_gpiod *s = state;
    const struct device_count counts[] = {
        {"steps", s->axis.stepper.steps},    {"late_steps", s->axis.stepper.late_steps},
        {"homings", s->axis.homings},        {"limit_hits", s->axis.limit_hits},
        {"emergency_stops", s->axis.estops},
    };

    memcpy(out, counts, sizeof counts);
    return sizeof counts / sizeof *counts;
}

static void gpiod_close(void *state)
{
    struct stage_gpiod *s = state;

    stage_worker_destroy(s->worker);
    stepper_enable(&s->axis.stepper, false);
    gpio_close(s->gpio);
    free(s);
}

const struct stage_ops stage_gpiod_ops = {.scheme = "gpiod",
                                          .open = gpiod_open,
                                          .move = gpiod_move,
                                          .home = gpiod_home,
                                          .stop = gpiod_stop,
                                          .status = gpiod_status,
                                          .counts = gpiod_counts,
                                          .close = gpiod_close};
