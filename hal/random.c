/* SPDX-License-Identifier: MIT */
#include "hal/random.h"

#include <math.h>

static uint64_t splitmix(uint64_t *state)
{
    uint64_t z = (*state += UINT64_C(0x9e3779b97f4a7c15));
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

void random_seed(struct random *r, const uint64_t *words, size_t n_words)
{
    uint64_t state = 0;
    for (size_t i = 0; i < n_words; i++) {
        state ^= words[i];
        state = splitmix(&state);
    }
    for (int i = 0; i < 4; i++)
        r->s[i] = splitmix(&state);
}

static uint64_t rotate(uint64_t x, int k)
{
    return (x << k) | (x >> (64 - k));
}

static uint64_t next(struct random *r)
{
    uint64_t *s = r->s, result = s[0] + s[3], t = s[1] << 17;
    s[2] ^= s[0];
    s[3] ^= s[1];
    s[1] ^= s[2];
    s[0] ^= s[3];
    s[2] ^= t;
    s[3] = rotate(s[3], 45);
    return result;
}

double random_even(struct random *r)
{
    return (double)(next(r) >> 11) * 0x1p-53;
}

/* Box and Muller 1958; 1 - even is never 0. */
double random_normal(struct random *r)
{
    double radius = sqrt(-2 * log(1 - random_even(r)));
    return radius * cos(2 * M_PI * random_even(r));
}

void random_add_noise(struct random *r, float *x, size_t n, float sigma)
{
    for (size_t i = 0; i < n; i += 2) {
        uint64_t bits = next(r);
        float u = (float)((bits >> 40) + 1) * 0x1p-24f; /* (0, 1] */
        float turn = (float)((bits >> 16) & 0xffffff) * 0x1p-24f;
        float radius = sigma * sqrtf(-2 * logf(u));
        float angle = (float)(2 * M_PI) * turn;
        x[i] += radius * cosf(angle);
        if (i + 1 < n)
            x[i + 1] += radius * sinf(angle);
    }
}
