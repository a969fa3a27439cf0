/* SPDX-License-Identifier: MIT */
/* recon/root.h -- square roots for inner loops, several times as fast as the processor's
 * when many are taken at once. */
#ifndef ANLOS_RECON_ROOT_H
#define ANLOS_RECON_ROOT_H

#include <stdint.h>
#include <string.h>

#include "dsp/vector.h"

/* sqrt(x) to 3e-7 of itself, for x of 0 or 1e-30..1e30: halves the exponent for a guess
 * of 1 / sqrt(x), then Newton's iteration three times.  (Lomont 2003, "Fast inverse
 * square root".) */
VECTOR_INLINE float root(float x)
{
    uint32_t bits;
    float y;
    memcpy(&bits, &x, sizeof bits);
    bits = 0x5f375a86u - (bits >> 1);
    memcpy(&y, &bits, sizeof y);
    float half = 0.5f * x;
    y *= 1.5f - half * y * y;
    y *= 1.5f - half * y * y;
    y *= 1.5f - half * y * y;
    return x * y;
}

#endif
