/* SPDX-License-Identifier: MIT */
#include "hal/stage/stepper.h"

#include <math.h>
#include <stdlib.h>

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
