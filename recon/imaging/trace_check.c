/* SPDX-License-Identifier: MIT */
#include "recon/imaging/trace_check.h"

#include <stdint.h>

#include "dsp/vector.h"

#define LOUDEST_BITS 0x551184e7u /* 1e13f; what is no number has larger ones */

typedef uint32_t float_bits __attribute__((may_alias));

/* On bits: comparisons of floats would branch, or call NaN neither. */
VECTOR_CLONES
static uint32_t loudest(const float_bits *bits, size_t n)
{
    uint32_t most = 0;
    for (size_t i = 0; i < n; i++) {
        uint32_t magnitude = bits[i] & 0x7fffffffu;
        most = magnitude > most ? magnitude : most;
    }
    return most;
}

bool trace_check(const float complex *trace, size_t n)
{
    return loudest((const float_bits *)trace, 2 * n) < LOUDEST_BITS;
}
