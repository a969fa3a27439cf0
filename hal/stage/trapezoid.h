/* hal/stage/trapezoid.h -- position over time of what starts, moves and stops at a
 * limited speed and acceleration: the speed is a trapezoid, or a triangle where the way
 * is too short for full speed.  Any unit of length: metres, steps.  Pure functions; times
 * in seconds. */
#ifndef ANLOS_HAL_STAGE_TRAPEZOID_H
#define ANLOS_HAL_STAGE_TRAPEZOID_H

#include <stddef.h>

/* Pieces of constant acceleration, one after the other. */
struct trapezoid {
    size_t n_pieces;
    struct {
        double duration_s, acceleration;
    } pieces[4];
    double start, start_speed;
};

/* From x, at speed v (signed), to rest at the target.  speed, acceleration > 0.  Where v
 * leads away from the target or past it, it brakes to rest first. */
void trapezoid_plan(struct trapezoid *t, double x, double v, double target, double speed,
                    double acceleration);

double trapezoid_duration_s(const struct trapezoid *t);

/* Position after time_s; *speed too. */
double trapezoid_at(const struct trapezoid *t, double time_s, double *speed);

/* When position x is first reached.  For plans without a turn (v was 0 or led to the
 * target); an x beyond the end is reached at the end. */
double trapezoid_time_s(const struct trapezoid *t, double x);

#endif
