/* SPDX-License-Identifier: MIT */
/* hal/random.h -- repeatable random numbers for simulations: the same seed gives the same
 * sequence on every machine.  xoshiro256+, seeded by splitmix64 (Vigna 2018). */
#ifndef ANLOS_HAL_RANDOM_H
#define ANLOS_HAL_RANDOM_H

#include <stddef.h>
#include <stdint.h>

struct random {
    uint64_t s[4];
};

/* A sequence for each tuple of words, e.g. (seed, pass, position, take). */
void random_seed(struct random *r, const uint64_t *words, size_t n_words);

/* Even in [0, 1). */
double random_even(struct random *r);

/* Gaussian, mean 0, standard deviation 1. */
double random_normal(struct random *r);

/* x[n] += sigma * normal. */
void random_add_noise(struct random *r, float *x, size_t n, float sigma);

#endif
