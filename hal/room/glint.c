/* SPDX-License-Identifier: MIT */
#include "hal/room/glint.h"

#include <math.h>
#include <string.h>

#include "hal/room/vector.h"

#define ROUNDING 1e-6

enum { TURNS = 4, STEPS = 30 };

bool glint_is_part(const struct glint_part *p)
{
    return vector_dot(p->half_axes[0], p->half_axes[0]) > 0;
}

bool glint_is_whole(const struct glint_part *p)
{
    bool is_whole = glint_is_part(p);
    for (int k = 0; k < 3; k++)
        is_whole = is_whole && p->from[k] <= -1 && p->to[k] >= 1;
    return is_whole;
}

/* In the frame of the half-axes, in metres. */
static void to_part(const struct glint_part *p, const double centre[3],
                    const double size_m[3], const double at[3], double out[3])
{
    double from_centre[3];
    vector_add(at, -1, centre, from_centre);
    for (int k = 0; k < 3; k++)
        out[k] = vector_dot(from_centre, p->half_axes[k]) / size_m[k];
}

/* The place of an ellipsoid that is nearest to one outside of it (Eberly 2013, "Distance
 * from a point to an ellipse, an ellipsoid"): Newton's steps towards the root of a convex
 * function from its steep side.  false: y is inside. */
static bool nearest(const double size_m[3], const double y[3], double out[3])
{
    double t = 0;
    for (int k = 0; k < 3; k++) /* where one term alone is 1 */
        t = fmax(t, size_m[k] * (fabs(y[k]) - size_m[k]));
    for (int step = 0; step < STEPS; step++) {
        double over = -1, slope = 0;
        for (int k = 0; k < 3; k++) {
            double s2 = size_m[k] * size_m[k], x = size_m[k] * y[k] / (t + s2);
            over += x * x;
            slope -= 2 * x * x / (t + s2);
        }
        if (t == 0 && over <= 0)
            return false;
        t -= over / slope;
        if (over < 1e-12)
            break;
    }
    for (int k = 0; k < 3; k++)
        out[k] = size_m[k] * size_m[k] * y[k] / (t + size_m[k] * size_m[k]);
    return true;
}

/* From where one element alone, at once source and receiver, would hear q glint, if it
 * does from a to b: on the line that halves the angle between them (Kell 1965, "On the
 * derivation of bistatic RCS from monostatic measurements"), as far away as their fronts
 * there are curved. */
static void monostatic_equivalent(const double q[3], const double a[3], const double b[3],
                                  double out[3])
{
    double to_a[3], to_b[3];
    vector_add(a, -1, q, to_a);
    vector_add(b, -1, q, to_b);
    double r_a = vector_normalize(to_a), r_b = vector_normalize(to_b);
    vector_add(to_a, 1, to_b, out);
    vector_normalize(out);
    vector_add(q, 2 / (1 / r_a + 1 / r_b), out, out);
}

/* Of an ellipsoid's place q: its Gaussian curvature is 1 / (abc)^2 n^4, the sum of both
 * curvatures (a^2 + b^2 + c^2 - q^2) / (abc)^2 n^3 with n the root of the sum of q^2 over
 * the fourth powers. */
static double scattering_length(const double size_m[3], const double q[3],
                                const double a[3], const double b[3])
{
    double to_a[3], to_b[3], n2 = 0, volume = 1, sum = 0;
    for (int k = 0; k < 3; k++) {
        n2 += pow(q[k] / (size_m[k] * size_m[k]), 2);
        volume *= size_m[k];
        sum += size_m[k] * size_m[k] - q[k] * q[k];
    }
    vector_add(a, -1, q, to_a);
    vector_add(b, -1, q, to_b);
    double fronts = 1 / sqrt(vector_dot(to_a, to_a)) + 1 / sqrt(vector_dot(to_b, to_b));
    double both = sum / (volume * volume * n2 * sqrt(n2));
    double product = 1 / (volume * volume * n2 * n2);
    return 1 / sqrt(fronts * fronts + 2 * fronts * both + 4 * product);
}

bool glint_find(const struct glint_part *p, const double centre[3], const double a[3],
                const double b[3], double at[3], double *scattering_length_m)
{
    double size_m[3], a_m[3], b_m[3], y[3], q[3];
    for (int k = 0; k < 3; k++)
        size_m[k] = sqrt(vector_dot(p->half_axes[k], p->half_axes[k]));
    to_part(p, centre, size_m, a, a_m);
    to_part(p, centre, size_m, b, b_m);
    for (int k = 0; k < 3; k++)
        y[k] = (a_m[k] + b_m[k]) / 2;
    for (int turn = 0; turn < TURNS; turn++) {
        if (!nearest(size_m, y, q))
            return false;
        monostatic_equivalent(q, a_m, b_m, y);
    }
    memcpy(at, centre, 3 * sizeof *at);
    for (int k = 0; k < 3; k++) {
        double part = q[k] / size_m[k];
        if (part < p->from[k] - ROUNDING || part > p->to[k] + ROUNDING)
            return false;
        vector_add(at, part, p->half_axes[k], at);
    }
    *scattering_length_m = scattering_length(size_m, q, a_m, b_m);
    return true;
}

/* A point in the frame in which the ellipsoid is the unit ball. */
static void to_ball(const struct glint_part *p, const double centre[3],
                    const double at[3], double out[3])
{
    double from_centre[3];
    vector_add(at, -1, centre, from_centre);
    for (int k = 0; k < 3; k++)
        out[k] = vector_dot(from_centre, p->half_axes[k]) /
                 vector_dot(p->half_axes[k], p->half_axes[k]);
}

bool glint_hides(const struct glint_part *p, const double centre[3], const double a[3],
                 const double b[3])
{
    double from[3], to[3], way[3], nearest[3];
    to_ball(p, centre, a, from);
    to_ball(p, centre, b, to);
    vector_add(to, -1, from, way);
    double t = -vector_dot(from, way) / vector_dot(way, way);
    vector_add(from, fmin(fmax(t, 0), 1), way, nearest);
    return vector_dot(nearest, nearest) < 1;
}
