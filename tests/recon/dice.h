/* SPDX-License-Identifier: MIT */
/* tests/recon/dice.h -- random numbers of tests that count. */
#ifndef ANLOS_TESTS_RECON_DICE_H
#define ANLOS_TESTS_RECON_DICE_H

#include <math.h>

#include "tests/recon/reference.h"

/* Normally distributed (Box and Muller 1958). */
static inline double dice_normal(unsigned long long *seed)
{
    double radius = sqrt(-2.0 * log(1.0 - reference_random(seed)));
    return radius * cos(2.0 * M_PI * reference_random(seed));
}

/* Poisson distributed (Knuth). */
static inline unsigned dice_poisson(double mean, unsigned long long *seed)
{
    double product = reference_random(seed), limit = exp(-mean);
    unsigned n = 0;

    for (; product > limit; n++)
        product *= reference_random(seed);
    return n;
}

#endif
