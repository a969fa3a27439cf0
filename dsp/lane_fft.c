/* SPDX-License-Identifier: MIT */
#include "dsp/lane_fft.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

/* What is left of n without its factors 4; 0 when n is none of ours. */
static size_t find_leaf(size_t n)
{
    if (n < 4 || n % 4 != 0)
        return 0;
    while (n >= 4 && n % 4 == 0)
        n /= 4;
    return n <= 3 || n == 5 ? n : 0;
}

bool lane_fft_transforms(size_t n)
{
    return find_leaf(n) > 0;
}

size_t lane_fft_size(size_t least)
{
    size_t n = least < 4 ? 4 : least;
    while (!find_leaf(n) || find_leaf(n) == 5)
        n++;
    return n;
}

/* All stages have 2 (n - leaf) floats: 6 (L / 4) for each length L of a block. */
static void plan_twiddles(struct lane_fft *f)
{
    float *w = f->twiddles;
    for (size_t block = f->n; block > f->leaf; block /= 4) {
        for (size_t j = 0; j < block / 4; j++) {
            for (size_t r = 1; r < 4; r++) {
                double phase = -2.0 * M_PI * (double)(r * j) / (double)block;
                *w++ = (float)cos(phase);
                *w++ = (float)sin(phase);
            }
        }
    }
}

/* A block's quarter r holds its frequencies that are r modulo 4. */
static void plan_order(struct lane_fft *f)
{
    for (size_t at = 0; at < f->n; at++) {
        size_t rest = at, step = 1, number = 0;
        for (size_t block = f->n; block > f->leaf; block /= 4, step *= 4) {
            number += rest / (block / 4) * step;
            rest %= block / 4;
        }
        f->number[at] = (uint32_t)(number + rest * step);
    }
}

int lane_fft_create(struct lane_fft **out, size_t n)
{
    size_t leaf = find_leaf(n);
    if (!leaf)
        return -EINVAL;
    struct lane_fft *f = calloc(1, sizeof *f);
    if (!f)
        return -ENOMEM;
    f->n = n;
    f->leaf = leaf;
    f->twiddles = malloc(2 * (n - leaf) * sizeof *f->twiddles);
    f->number = malloc(n * sizeof *f->number);
    if (!f->twiddles || !f->number) {
        lane_fft_destroy(f);
        return -ENOMEM;
    }
    plan_twiddles(f);
    plan_order(f);
    *out = f;
    return 0;
}

void lane_fft_destroy(struct lane_fft *f)
{
    if (!f)
        return;
    free(f->twiddles);
    free(f->number);
    free(f);
}
