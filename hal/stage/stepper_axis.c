/* SPDX-License-Identifier: MIT */
#include "hal/stage/stepper_axis.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "hal/clock.h"

#define NS_PER_S INT64_C(1000000000)
#define SPIN_NS  20000  /* shorter waits are not worth a sleep */
#define WAKE_NS  200000 /* poll wakes so much early, the timer does the rest */
#define REST_MS  1000

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

struct stepper_io stepper_gpio_io(struct stepper_gpio *g)
{
    return (struct stepper_io){.state = g,
                               .now_ns = gpio_now_ns,
                               .sleep = gpio_sleep,
                               .watch = gpio_watch,
                               .set = gpio_line_set,
                               .inputs = gpio_line_inputs,
                               .cancelled = gpio_cancelled};
}

/* A chip that is gone is readable for ever: only the clock and the waker count then. */
void stepper_gpio_rest(struct stepper_gpio *g, int wake_fd)
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

#define SLOW_PART    0.1 /* of the homing speed: the second, exact approach */
#define RANGE_MARGIN 1.2 /* of the range: farther away there is no home switch */
#define LEAVE_TIMES  5   /* back-offs: a home switch that is not open by then is stuck */
#define LIMITS       (STEPPER_BIT(STEPPER_HOME) | STEPPER_BIT(STEPPER_LIMIT))
#define ESTOP        STEPPER_BIT(STEPPER_ESTOP)

void stepper_axis_init(struct stepper_axis *a, const struct stepper_axis_config *cfg,
                       const struct stepper_config *stepper, const struct stepper_io *io)
{
    *a = (struct stepper_axis){.cfg = *cfg};
    stepper_init(&a->stepper, stepper, io);
}

static double home_m(const struct stepper_axis *a)
{
    return a->cfg.home_positive ? a->cfg.max_m : a->cfg.min_m;
}

/* +1 or -1: the way that leads away from home. */
static int64_t away(const struct stepper_axis *a)
{
    return a->cfg.home_positive ? -1 : 1;
}

static int64_t steps(const struct stepper_axis *a, double length_m)
{
    return llround(length_m * a->cfg.steps_per_m);
}

double stepper_axis_position_m(const struct stepper_axis *a)
{
    return home_m(a) + (double)(a->stepper.position - a->home_steps) / a->cfg.steps_per_m;
}

static int lose(struct stepper_axis *a, int err, const char *text)
{
    a->homed = false;
    snprintf(a->text, sizeof a->text, "%s; its place is not known until it is homed",
             text);
    return err;
}

static int lose_by_switch(struct stepper_axis *a, unsigned active)
{
    if (active & ESTOP) {
        a->estops++;
        stepper_enable(&a->stepper, false);
        return lose(a, -ESHUTDOWN, "emergency stop");
    }
    a->limit_hits++;
    return lose(a, -EIO,
                active & STEPPER_BIT(STEPPER_HOME) ? "the limit switch at home was hit"
                                                   : "the far limit switch was hit");
}

static int lose_by_error(struct stepper_axis *a, int err)
{
    char text[64];

    snprintf(text, sizeof text, "its GPIO lines fail: %s", strerror(-err));
    return lose(a, err, text);
}

/* Goes to `target` steps, past the switches in `ignore`.  Returns 1 where one of `until`
 * is active, which is what it looks for; any other ends the way for good. */
static int go(struct stepper_axis *a, int64_t target, double speed_m_s, unsigned until,
              unsigned ignore)
{
    struct stepper *s = &a->stepper;
    unsigned active, looked_at = (LIMITS & ~ignore) | ESTOP;
    int err = s->io.inputs(s->io.state, &active);

    if (err)
        return lose_by_error(a, err);
    active &= looked_at;
    if (active)
        return active & ~until ? lose_by_switch(a, active) : 1;
    struct stepper_run run = {
        .target = target, .speed = speed_m_s * a->cfg.steps_per_m, .stop_on = looked_at};
    switch (stepper_go(s, &run)) {
    case STEPPER_ARRIVED:
        return 0;
    case STEPPER_CANCELLED:
        return -ECANCELED;
    case STEPPER_ERROR:
        return lose_by_error(a, run.error);
    default:
        return run.active & ~until ? lose_by_switch(a, run.active) : 1;
    }
}

/* Steps away from home; the switch there may be open, closed, or bounce. */
static int back_off(struct stepper_axis *a, double speed_m_s)
{
    int64_t by = away(a) * steps(a, a->cfg.back_off_m);

    return go(a, a->stepper.position + by, speed_m_s, 0, STEPPER_BIT(STEPPER_HOME));
}

/* Off the switch, by a little more each time.  One that is stuck, or whose wire is
 * broken, must not send the stage across its range. */
static int leave_switch(struct stepper_axis *a, double speed_m_s)
{
    struct stepper *s = &a->stepper;
    int64_t end = s->position + away(a) * steps(a, LEAVE_TIMES * a->cfg.back_off_m);
    unsigned pressed, active;

    for (;;) {
        int err = back_off(a, speed_m_s);
        if (err)
            return err;
        err = s->io.inputs(s->io.state, &pressed); /* also on the way */
        if (!err)
            err = s->io.inputs(s->io.state, &active);
        if (err)
            return lose_by_error(a, err);
        if (pressed & ESTOP)
            return lose_by_switch(a, pressed);
        if (!(active & STEPPER_BIT(STEPPER_HOME)))
            return 0;
        if ((end - s->position) * away(a) <= 0)
            return lose(a, -EIO, "the home switch does not open");
    }
}

/* Where it starts on the far switch, that one is behind it. */
static int seek_switch(struct stepper_axis *a, double way_m, double speed_m_s)
{
    int64_t target = a->stepper.position - away(a) * steps(a, way_m);
    unsigned active;
    int found = a->stepper.io.inputs(a->stepper.io.state, &active);

    if (found)
        return lose_by_error(a, found);
    if (!(active & (STEPPER_BIT(STEPPER_HOME) | ESTOP)))
        found = go(a, target, speed_m_s, STEPPER_BIT(STEPPER_HOME),
                   active & STEPPER_BIT(STEPPER_LIMIT));
    else
        found = active & ESTOP ? lose_by_switch(a, active) : 1;
    if (!found)
        return lose(a, -EIO, "no home switch was found");
    return found < 0 ? found : 0;
}

static int find_home(struct stepper_axis *a)
{
    const struct stepper_axis_config *c = &a->cfg;
    double fast = c->home_speed_m_s, slow = SLOW_PART * fast;
    int err =
        seek_switch(a, RANGE_MARGIN * (c->max_m - c->min_m) + 2 * c->back_off_m, fast);

    if (!err)
        err = leave_switch(a, slow);
    if (!err)
        err = seek_switch(a, c->max_m - c->min_m + 2 * c->back_off_m, slow);
    return err ? err : back_off(a, slow);
}

int stepper_axis_home(struct stepper_axis *a)
{
    a->homed = false;
    a->text[0] = '\0';
    int err = a->cfg.has_home ? find_home(a)
                              : go(a, a->stepper.position, a->cfg.speed_m_s, 0, LIMITS);
    if (err == -ECANCELED)
        lose(a, err, "homing was broken off");
    if (err)
        return err;
    a->home_steps = a->stepper.position;
    a->taut = a->cfg.has_home;
    a->homed = true;
    a->homings++;
    return 0;
}

/* The switch at the end that this way leads away from: it may still be closed. */
static unsigned switch_behind(const struct stepper_axis *a, int64_t target)
{
    int64_t way = (target - a->stepper.position) * away(a);

    return STEPPER_BIT(way > 0 ? STEPPER_HOME : STEPPER_LIMIT);
}

/* Ignores a closed switch only where the axis stands on it. */
static int go_to(struct stepper_axis *a, int64_t target, double speed_m_s)
{
    unsigned active, behind = switch_behind(a, target);
    int err = a->stepper.io.inputs(a->stepper.io.state, &active);

    if (err)
        return lose_by_error(a, err);
    if (target == a->stepper.position && !active)
        return 0;
    if (active & ~behind)
        return lose_by_switch(a, active & ~behind);
    return go(a, target, speed_m_s > 0 ? speed_m_s : a->cfg.speed_m_s, 0,
              active & behind);
}

int stepper_axis_move(struct stepper_axis *a, double target_m, double speed_m_s)
{
    const struct stepper_axis_config *c = &a->cfg;

    a->text[0] = '\0';
    if (!(target_m >= c->min_m && target_m <= c->max_m))
        return -ERANGE;
    if (!a->homed)
        return -ESTALE;
    int64_t target = a->home_steps + steps(a, target_m - home_m(a));
    int64_t way = (target - a->stepper.position) * away(a);
    int64_t slack = steps(a, c->backlash_m);
    if (!way)
        return go_to(a, target, 0);
    bool taut = a->taut && way > 0;
    a->taut = false;
    int err = taut || way >= slack || !slack ? 0 : go_to(a, target - away(a) * slack, 0);
    if (!err)
        err = go_to(a, target, speed_m_s);
    a->taut = !err;
    return err;
}

int stepper_axis_watch(struct stepper_axis *a)
{
    unsigned active;
    int err = a->stepper.io.inputs(a->stepper.io.state, &active);

    if (err)
        return lose_by_error(a, err);
    /* An emergency stop lets go of a motor that only holds, too. */
    bool news = a->homed || (active & ESTOP && a->stepper.enabled);
    return active && news ? lose_by_switch(a, active) : 0;
}
