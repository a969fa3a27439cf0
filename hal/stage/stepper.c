/* SPDX-License-Identifier: MIT */
#include "hal/stage/stepper.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void add_piece(struct trapezoid *t, double duration_s, double acceleration)
{
    t->pieces[t->n_pieces].duration_s = duration_s;
    t->pieces[t->n_pieces++].acceleration = acceleration;
}

void trapezoid_plan(struct trapezoid *t, double x, double v, double target, double speed,
                    double acceleration)
{
    double a = acceleration, brake = 0.5 * v * fabs(v) / a;

    *t = (struct trapezoid){.start = x, .start_speed = v};
    if (v * (target - x) < 0 || fabs(brake) > fabs(target - x)) {
        add_piece(t, fabs(v) / a, -copysign(a, v));
        x += brake;
        v = 0;
    }
    double way = fabs(target - x), sign = copysign(1, target - x);
    double peak = fmin(speed, sqrt(a * way + 0.5 * v * v));
    if (way == 0)
        return;
    v = fabs(v);
    double ramps = fabs(peak * peak - v * v) / (2 * a) + peak * peak / (2 * a);
    add_piece(t, fabs(peak - v) / a, peak < v ? -sign * a : sign * a);
    add_piece(t, fmax(0, way - ramps) / peak, 0);
    add_piece(t, peak / a, -sign * a);
}

double trapezoid_duration_s(const struct trapezoid *t)
{
    double sum = 0;

    for (size_t i = 0; i < t->n_pieces; i++)
        sum += t->pieces[i].duration_s;
    return sum;
}

double trapezoid_at(const struct trapezoid *t, double time_s, double *speed)
{
    double x = t->start, v = t->start_speed;

    for (size_t i = 0; i < t->n_pieces && time_s > 0; i++) {
        double a = t->pieces[i].acceleration;
        double dt = fmin(time_s, t->pieces[i].duration_s);
        x += v * dt + 0.5 * a * dt * dt;
        v += a * dt;
        time_s -= dt;
    }
    *speed = v;
    return x;
}

/* Way left of a piece: v dt + a dt dt / 2 = way, in the form that does not cancel. */
double trapezoid_time_s(const struct trapezoid *t, double x)
{
    double sum = 0, v = t->start_speed, left = x - t->start;

    for (size_t i = 0; i < t->n_pieces; i++) {
        double a = t->pieces[i].acceleration, dt = t->pieces[i].duration_s;
        double way = v * dt + 0.5 * a * dt * dt;
        if (fabs(left) <= fabs(way)) {
            double end = sqrt(fmax(0, v * v + 2 * a * left));
            double mean = 0.5 * (fabs(v) + end);
            return sum + (mean > 0 ? fmin(dt, fabs(left) / mean) : 0);
        }
        left -= way;
        v += a * dt;
        sum += dt;
    }
    return sum;
}

/* A step later than this part of its interval is late: the motor has slowed down. */
#define LATE_PART 0.25

/* The way that is being gone. */
struct way {
    struct trapezoid plan; /* over steps made from `from`, in time since `begin_ns` */
    int64_t from, target;
    int64_t begin_ns;
    double interval_s; /* of the step that comes */
    double done_s;     /* of the plan, at the step before */
    bool braking;
};

void stepper_init(struct stepper *s, const struct stepper_config *cfg,
                  const struct stepper_io *io)
{
    *s = (struct stepper){.cfg = *cfg, .io = *io};
}

int stepper_enable(struct stepper *s, bool on)
{
    if (s->enabled == on)
        return 0;
    int err = s->io.set(s->io.state, STEPPER_ENABLE, on);
    if (err)
        return err;
    s->enabled = on;
    if (on)
        s->io.sleep(s->io.state, s->io.now_ns(s->io.state) + s->cfg.enable_ns);
    return 0;
}

static int64_t seconds_ns(double s)
{
    return (int64_t)ceil(1e9 * s);
}

/* From here at this speed, with the clock at now_ns. */
static void plan(struct stepper *s, struct way *w, double speed, double max_speed,
                 int64_t now_ns)
{
    double n = fabs((double)(w->target - s->position));

    w->from = s->position;
    w->begin_ns = now_ns;
    w->done_s = 0;
    trapezoid_plan(&w->plan, 0, speed, n, max_speed, s->cfg.acceleration);
}

/* When the next step is to be, by the plan. */
static int64_t next_ns(const struct stepper *s, struct way *w)
{
    double step_s = trapezoid_time_s(&w->plan, fabs((double)(s->position - w->from)) + 1);

    w->interval_s = step_s - w->done_s;
    w->done_s = step_s;
    return w->begin_ns + seconds_ns(step_s);
}

/* The nearest step at which it can be at rest. */
static void brake(struct stepper *s, struct way *w, double max_speed, int64_t now_ns)
{
    double v;

    trapezoid_at(&w->plan, w->done_s, &v);
    int64_t n = (int64_t)ceil(v * v / (2 * s->cfg.acceleration));
    w->braking = true;
    if (n < llabs(w->target - s->position))
        w->target = s->position + (s->forward ? n : -n);
    plan(s, w, v, max_speed, now_ns);
}

static int set_direction(struct stepper *s, bool forward)
{
    if (s->direction_set && s->forward == forward)
        return 0;
    int err = s->io.set(s->io.state, STEPPER_DIRECTION, forward);
    if (err)
        return err;
    s->forward = forward;
    s->direction_set = true;
    s->io.sleep(s->io.state, s->io.now_ns(s->io.state) + s->cfg.direction_setup_ns);
    return 0;
}

static int pulse(struct stepper *s)
{
    int err = s->io.set(s->io.state, STEPPER_STEP, true);

    if (err)
        return err;
    s->position += s->forward ? 1 : -1;
    s->steps++;
    s->io.sleep(s->io.state, s->io.now_ns(s->io.state) + s->cfg.pulse_ns);
    err = s->io.set(s->io.state, STEPPER_STEP, false);
    s->ready_ns = s->io.now_ns(s->io.state) + s->cfg.pulse_ns;
    return err;
}

/* Waits for the time of the next step, and looks at the switches meanwhile. */
static int wait_for(struct stepper *s, struct stepper_run *run, int64_t t_ns,
                    unsigned *active)
{
    if (t_ns < s->ready_ns) /* the pulse before came late */
        t_ns = s->ready_ns;
    do {
        s->io.watch(s->io.state, t_ns);
        int err = s->io.inputs(s->io.state, active);
        if (err)
            return err;
        *active &= run->stop_on;
    } while (!*active && s->io.now_ns(s->io.state) < t_ns);
    return 0;
}

/* A step that came late by so much: what follows is as much later.  Where it broke the
 * rhythm, it goes on from the speed that was left. */
static void stretch(struct stepper *s, struct way *w, double max_speed, int64_t now_ns,
                    int64_t late_ns)
{
    w->begin_ns += late_ns;
    if (1e-9 * (double)late_ns <= LATE_PART * w->interval_s)
        return;
    double v, left = 1 / (w->interval_s + 1e-9 * (double)late_ns);
    trapezoid_at(&w->plan, w->done_s, &v);
    s->late_steps++;
    plan(s, w, fmin(v, left), max_speed, now_ns);
}

static enum stepper_end ended(struct stepper_run *run, enum stepper_end end, int error)
{
    run->error = error;
    return end;
}

enum stepper_end stepper_go(struct stepper *s, struct stepper_run *run)
{
    struct way w = {.target = run->target};
    unsigned active = 0;
    int err = stepper_enable(s, true);

    run->active = 0;
    if (!err && run->target != s->position)
        err = set_direction(s, run->target > s->position);
    plan(s, &w, 0, run->speed, s->io.now_ns(s->io.state));
    while (!err && s->position != w.target) {
        if (!w.braking && s->io.cancelled(s->io.state)) {
            brake(s, &w, run->speed, s->io.now_ns(s->io.state));
            continue;
        }
        int64_t t_ns = next_ns(s, &w);
        err = wait_for(s, run, t_ns, &active);
        if (err || active)
            break;
        int64_t now_ns = s->io.now_ns(s->io.state);
        err = pulse(s);
        stretch(s, &w, run->speed, now_ns, now_ns - t_ns);
    }
    run->active = active;
    if (err)
        return ended(run, STEPPER_ERROR, err);
    return ended(run,
                 active      ? STEPPER_INPUT
                 : w.braking ? STEPPER_CANCELLED
                             : STEPPER_ARRIVED,
                 0);
}

/* -- an axis: home, switches, metres ----------------------------------------------------
 */

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
