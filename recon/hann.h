/* SPDX-License-Identifier: MIT */
/* recon/hann.h -- a pulse whose spectrum is a Hann window over the band, as compression
 * leaves it. */
#ifndef ANLOS_RECON_HANN_H
#define ANLOS_RECON_HANN_H

#include <math.h>

#define HANN_VARIANCE 0.0326727 /* of a window of width 1: 1 / 12 - 1 / (2 pi^2) */

/* Of a band of width 1, at a time x: sinc(x) / (1 - x^2). */
static inline double hann_pulse(double x)
{
    double y = M_PI * x;
    if (fabs(x) < 1e-6)
        return 1.0;
    if (fabs(fabs(x) - 1.0) < 1e-6)
        return 0.5;
    return sin(y) / (y * (1.0 - x * x));
}

#endif
