#include "hal/stage/trapezoid.h"

#include <math.h>

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
