/* SPDX-License-Identifier: MIT */
#include "hal/room/arrivals.h"

#include <math.h>
#include <stdlib.h>

/* Modified Bessel function of the first kind, order 0: its series. */
static double bessel_i0(double x)
{
    double sum = 1, term = 1;
    for (int k = 1; term > 1e-17 * sum; k++) {
        term *= x / (2 * k) * (x / (2 * k));
        sum += term;
    }
    return sum;
}

/* Kaiser's rule (1974): 12 taps and a transition of half the band stop 90 dB down. */
static double kernel(double x)
{
    const double half = ARRIVALS_TAPS / 2, beta = 8.8;
    if (fabs(x) >= half)
        return 0;
    double sinc = x == 0 ? 1 : sin(M_PI * x) / (M_PI * x);
    return sinc * bessel_i0(beta * sqrt(1 - x * x / (half * half))) / bessel_i0(beta);
}

struct arrivals *arrivals_create(void)
{
    struct arrivals *a = malloc(sizeof *a);
    if (!a)
        return NULL;
    for (int p = 0; p <= ARRIVALS_PHASES; p++) {
        double w[ARRIVALS_TAPS], sum = 0;
        for (int k = 0; k < ARRIVALS_TAPS; k++) {
            double at = k - (ARRIVALS_TAPS / 2 - 1);
            w[k] = kernel(at - (double)p / ARRIVALS_PHASES);
            sum += w[k];
        }
        for (int k = 0; k < ARRIVALS_TAPS; k++)
            a->weights[p][k] = (float)(w[k] / sum);
    }
    return a;
}
