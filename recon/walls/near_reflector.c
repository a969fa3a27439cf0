/* SPDX-License-Identifier: MIT */
#include "recon/walls/near_reflector.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "recon/geometry.h"

#define ROUNDS      8
#define LEAST_HEARD 6
#define LEAST_PIVOT 1e-4

/* By way of the point, and how that grows when the point moves. */
static double path_by(const struct wall_echo *e, const double at[3], double slope[3])
{
    double in = geometry_distance(e->speaker_m, at);
    double out = geometry_distance(at, e->microphone_m), growth = 0.0;
    for (int a = 0; a < 3; a++) {
        slope[a] = (at[a] - e->speaker_m[a]) / fmax(in, 1e-6) +
                   (at[a] - e->microphone_m[a]) / fmax(out, 1e-6);
        growth -= slope[a] * e->velocity_m_s[a];
    }
    return in + out + e->lag_s * growth;
}

/* The echo of the pair that begins at *i; *i moves on to the next pair.  How far it is
 * from the point's path. */
static double nearest(const struct near_reflector *t, const struct wall_echo *echoes,
                      size_t n, size_t *i, double slope[3])
{
    uint32_t pair = echoes[*i].pair;
    double path_m = path_by(&echoes[*i], t->at_m, slope), best = INFINITY;
    for (; *i < n && echoes[*i].pair == pair; (*i)++)
        if (fabs(echoes[*i].path_m - path_m) < fabs(best))
            best = echoes[*i].path_m - path_m;
    return best;
}

static int improve_once(struct near_reflector *t, const struct wall_echo *echoes,
                        size_t n, double tolerance)
{
    double a[9] = {0.0}, b[3] = {0.0}, sum = 0.0;
    t->n_heard = 0;
    for (size_t i = 0; i < n;) {
        double slope[3], r = nearest(t, echoes, n, &i, slope);
        if (fabs(r) > tolerance)
            continue;
        double u = r / tolerance, weight = (1.0 - u * u) * (1.0 - u * u);
        t->n_heard++;
        sum += r * r;
        for (int p = 0; p < 3; p++) {
            b[p] += weight * slope[p] * r;
            for (int q = 0; q < 3; q++)
                a[3 * p + q] += weight * slope[p] * slope[q];
        }
    }
    if (t->n_heard < LEAST_HEARD)
        return -EDOM;
    t->rms_m = sqrt(sum / (double)t->n_heard);
    normal_equations_solve(3, a, b, LEAST_PIVOT);
    for (int p = 0; p < 3; p++)
        t->at_m[p] += b[p];
    return 0;
}

int near_reflector_improve(struct near_reflector *t, const struct wall_echo *echoes,
                           size_t n, const double tolerance_m[2])
{
    int err = 0;
    for (int k = 0; !err && k < ROUNDS; k++) {
        double part = (double)k / (ROUNDS - 2.0);
        err =
            improve_once(t, echoes, n,
                         fmax(tolerance_m[1],
                              tolerance_m[0] + part * (tolerance_m[1] - tolerance_m[0])));
    }
    return err;
}
