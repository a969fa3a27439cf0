/* SPDX-License-Identifier: MIT */
#include "recon/coherent/sinc.h"

#include <math.h>

/* Modified Bessel function of order 0, by its series: arguments here are below 20. */
static double bessel_i0(double x)
{
    double sum = 1.0, term = 1.0;
    for (int k = 1; k < 60 && term > 1e-17 * sum; k++) {
        term *= (x / (2.0 * k)) * (x / (2.0 * k));
        sum += term;
    }
    return sum;
}

static double sinc(double x)
{
    return fabs(x) < 1e-9 ? 1.0 : sin(M_PI * x) / (M_PI * x);
}

void sinc_weights(size_t n_taps, double occupancy, double fraction, double *out)
{
    double half = 0.5 * (double)n_taps;
    double attenuation_db = 8.0 + 2.285 * (double)n_taps * 2.0 * M_PI * (1.0 - occupancy);
    double beta = attenuation_db > 50.0
                      ? 0.1102 * (attenuation_db - 8.7)
                      : 0.5842 * pow(fmax(attenuation_db - 21.0, 0.0), 0.4) +
                            0.07886 * fmax(attenuation_db - 21.0, 0.0);
    double sum = 0.0;
    for (size_t q = 0; q < n_taps; q++) {
        double x = (double)q - (half - 1.0) - fraction;
        double u = x / half;
        double window = u * u < 1.0 ? bessel_i0(beta * sqrt(1.0 - u * u)) : 0.0;
        out[q] = sinc(x) * window;
        sum += out[q];
    }
    for (size_t q = 0; q < n_taps; q++)
        out[q] /= sum;
}
