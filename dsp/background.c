/* SPDX-License-Identifier: MIT */
#include "dsp/background.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

struct background {
    size_t n_pings;
    size_t n_values;       /* in a ping: n_channels * n_samples */
    float complex *traces; /* [n_pings][n_values] */
    bool *stored;          /* [n_pings] */
};

int background_create(struct background **out, size_t n_pings, size_t n_channels,
                      size_t n_samples)
{
    struct background *b;
    size_t n;

    if (!out || !n_pings || !n_channels || !n_samples)
        return -EINVAL;
    if (__builtin_mul_overflow(n_channels, n_samples, &n) ||
        __builtin_mul_overflow(n, n_pings, &n) || n > SIZE_MAX / sizeof(float complex))
        return -ENOMEM;
    b = calloc(1, sizeof(*b));
    if (!b)
        return -ENOMEM;
    b->n_pings = n_pings;
    b->n_values = n_channels * n_samples;
    b->traces = malloc(n * sizeof(*b->traces));
    b->stored = calloc(n_pings, sizeof(*b->stored));
    if (!b->traces || !b->stored) {
        background_destroy(b);
        return -ENOMEM;
    }
    *out = b;
    return 0;
}

void background_store(struct background *b, size_t ping, const float complex *traces)
{
    if (ping >= b->n_pings)
        return;
    memcpy(b->traces + ping * b->n_values, traces, b->n_values * sizeof(*traces));
    b->stored[ping] = true;
}

const float complex *background_traces(const struct background *b, size_t ping)
{
    return ping < b->n_pings && b->stored[ping] ? b->traces + ping * b->n_values : NULL;
}

void background_destroy(struct background *b)
{
    if (!b)
        return;
    free(b->traces);
    free(b->stored);
    free(b);
}
