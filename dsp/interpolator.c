/* SPDX-License-Identifier: MIT */
#include "dsp/interpolator.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"

#define TAPS  INTERPOLATOR_TAPS
#define STEPS 256  /* linear between them: -100 dB */
#define RIDGE 1e-9 /* keeps the normal equations regular at low occupancy */

struct interpolator {
    float table[STEPS + 1][2 * TAPS]; /* weights, and those of the derivative */
};

static double sinc(double x)
{
    return fabs(x) < 1e-6 ? 1.0 - M_PI * M_PI * x * x / 6.0 : sin(M_PI * x) / (M_PI * x);
}

static double sinc_slope(double x)
{
    return fabs(x) < 1e-4 ? -M_PI * M_PI * x / 3.0 : (cos(M_PI * x) - sinc(x)) / x;
}

/* r is positive definite by its ridge. */
static void solve(const double r[TAPS][TAPS], double x[TAPS])
{
    double a[TAPS][TAPS];
    memcpy(a, r, sizeof a);
    normal_equations_solve(TAPS, a[0], x, 0.0);
}

/* The signal's correlation is sinc(occupancy lag): weights w solve R w = r(fraction). */
static void fill(struct interpolator *ip, double occupancy)
{
    double r[TAPS][TAPS];

    for (int i = 0; i < TAPS; i++)
        for (int j = 0; j < TAPS; j++)
            r[i][j] = sinc(occupancy * (i - j)) + (i == j ? RIDGE : 0.0);
    for (int step = 0; step <= STEPS; step++) {
        double value[TAPS], slope[TAPS];
        for (int q = 0; q < TAPS; q++) {
            double lag = (double)step / STEPS - (q - INTERPOLATOR_BEFORE);
            value[q] = sinc(occupancy * lag);
            slope[q] = occupancy * sinc_slope(occupancy * lag);
        }
        solve((const double(*)[TAPS])r, value);
        solve((const double(*)[TAPS])r, slope);
        for (int q = 0; q < TAPS; q++) {
            ip->table[step][q] = (float)value[q];
            ip->table[step][TAPS + q] = (float)slope[q];
        }
    }
}

int interpolator_create(struct interpolator **out, double occupancy)
{
    struct interpolator *ip;

    if (!out || !(occupancy >= 0.05 && occupancy <= 0.9))
        return -EINVAL;
    ip = malloc(sizeof(*ip));
    if (!ip)
        return -ENOMEM;
    fill(ip, occupancy);
    *out = ip;
    return 0;
}

void interpolator_weights(const struct interpolator *ip, double fraction, float *out)
{
    double at = fmin(fmax(fraction, 0.0), 1.0) * STEPS;
    int step = (int)at < STEPS ? (int)at : STEPS - 1;
    float f = (float)(at - step);
    const float *a = ip->table[step], *b = ip->table[step + 1];

    for (int i = 0; i < 2 * TAPS; i++)
        out[i] = a[i] + f * (b[i] - a[i]);
}

void interpolator_destroy(struct interpolator *ip)
{
    free(ip);
}
