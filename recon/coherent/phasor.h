/* SPDX-License-Identifier: MIT */
/* recon/coherent/phasor.h -- a carrier's phase, fast enough for inner loops and free of
 * branches, so that they vectorise. */
#ifndef ANLOS_RECON_COHERENT_PHASOR_H
#define ANLOS_RECON_COHERENT_PHASOR_H

#include <math.h>

#include "dsp/vector.h"

/* exp(2 pi i turns): half the angle by its Taylor series, then doubled.  Error below 3e-7
 * for any finite turns, besides the rounding of turns itself. */
VECTOR_INLINE void phasor(float turns, float *re, float *im)
{
    float u = (float)M_PI * (turns - rintf(turns)), v = u * u;
    float s = -2.5052108e-8f, c = 2.0876757e-9f;
    s = 2.7557319e-6f + v * s;
    s = -1.9841270e-4f + v * s;
    s = 8.3333333e-3f + v * s;
    s = -1.6666667e-1f + v * s;
    s = u + u * v * s;
    c = -2.7557319e-7f + v * c;
    c = 2.4801587e-5f + v * c;
    c = -1.3888889e-3f + v * c;
    c = 4.1666667e-2f + v * c;
    c = -0.5f + v * c;
    c = 1.0f + v * c;
    *re = 1.0f - 2.0f * s * s;
    *im = 2.0f * s * c;
}

#endif
