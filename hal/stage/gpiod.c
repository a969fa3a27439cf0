/* SPDX-License-Identifier: MIT */
#include "hal/stage/gpiod.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "hal/clock.h"
#include "hal/stage.h"
#include "hal/stage/worker.h"

/* -- what it is named by ---------------------------------------------------------------
 */

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

/* -- its lines on the chip, and its clock
 * ------------------------------------------------
 */

#define NS_PER_S INT64_C(1000000000)
#define SPIN_NS  20000  /* shorter waits are not worth a sleep */
#define WAKE_NS  200000 /* poll wakes so much early, the timer does the rest */
#define REST_MS  1000

struct stepper_gpio {  /* CLOCK_MONOTONIC, by absolute timers */
    struct gpio *gpio; /* lines as enum stepper_line has them; not owned */
    void *owner;
    bool (*cancelled)(void *owner); /* also the place to say where the stage is */
};

static int64_t gpio_now_ns(void *state)
{
    (void)state;
    return clock_monotonic_ns();
}

static struct timespec timespec_of(int64_t ns)
{
    return (struct timespec){.tv_sec = (time_t)(ns / NS_PER_S), .tv_nsec = ns % NS_PER_S};
}

static void gpio_sleep(void *state, int64_t t_ns)
{
    const struct timespec at = timespec_of(t_ns);

    if (t_ns - gpio_now_ns(state) > SPIN_NS)
        while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR)
            ;
    while (gpio_now_ns(state) < t_ns)
        ;
}

static void gpio_watch(void *state, int64_t t_ns)
{
    struct stepper_gpio *g = state;
    struct pollfd fds[GPIO_MAX_LINES];
    int64_t left_ns = t_ns - gpio_now_ns(state) - WAKE_NS;
    size_t n = gpio_poll(g->gpio, fds);

    if (left_ns > 0 && n) {
        const struct timespec timeout = timespec_of(left_ns);
        if (ppoll(fds, n, &timeout, NULL) > 0)
            return;
    }
    gpio_sleep(state, t_ns);
}

static int gpio_line_set(void *state, enum stepper_line line, bool active)
{
    struct stepper_gpio *g = state;

    return gpio_set(g->gpio, line, active);
}

static int gpio_line_inputs(void *state, unsigned *active)
{
    struct stepper_gpio *g = state;

    return gpio_inputs(g->gpio, active);
}

static bool gpio_cancelled(void *state)
{
    struct stepper_gpio *g = state;

    return g->cancelled(g->owner);
}

/* The functions take g as their state: it has to live as long as they are used. */
static struct stepper_io stepper_gpio_io(struct stepper_gpio *g)
{
    return (struct stepper_io){.state = g,
                               .now_ns = gpio_now_ns,
                               .sleep = gpio_sleep,
                               .watch = gpio_watch,
                               .set = gpio_line_set,
                               .inputs = gpio_line_inputs,
                               .cancelled = gpio_cancelled};
}

/* At rest: until an input changes or wake_fd is readable, or for a second.  A chip that
 * is gone is readable for ever: only the clock and the waker count then. */
static void stepper_gpio_rest(struct stepper_gpio *g, int wake_fd)
{
    struct pollfd fds[1 + GPIO_MAX_LINES];
    size_t n = 1 + gpio_poll(g->gpio, fds + 1);

    fds[0] = (struct pollfd){.fd = wake_fd, .events = POLLIN};
    if (poll(fds, n, REST_MS) <= 0)
        return;
    for (size_t i = 1; i < n; i++)
        if (fds[i].revents & (POLLERR | POLLHUP | POLLNVAL)) {
            poll(fds, 1, REST_MS);
            return;
        }
}

/* -- the stage -------------------------------------------------------------------------
 */

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
    out->reach_m[0] = s->axis.cfg.min_m;
    out->reach_m[1] = s->axis.cfg.max_m;
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
