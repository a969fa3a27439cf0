/* SPDX-License-Identifier: MIT */
#include "dsp/trace_mean.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

struct trace_mean {
    size_t n_pings, n_channels, n_samples;
    float complex *mean; /* [n_pings][n_channels][n_samples] */
    uint32_t *taken;     /* [n_pings][n_channels] */
};

int trace_mean_create(struct trace_mean **out, size_t n_pings, size_t n_channels,
                      size_t n_samples)
{
    size_t n;

    if (!n_pings || !n_channels || !n_samples)
        return -EINVAL;
    if (__builtin_mul_overflow(n_pings, n_channels, &n) ||
        __builtin_mul_overflow(n, n_samples, &n))
        return -ENOMEM;
    struct trace_mean *m = calloc(1, sizeof *m);
    if (!m)
        return -ENOMEM;
    *m = (struct trace_mean){
        .n_pings = n_pings, .n_channels = n_channels, .n_samples = n_samples};
    m->mean = calloc(n, sizeof *m->mean);
    m->taken = calloc(n_pings * n_channels, sizeof *m->taken);
    if (!m->mean || !m->taken) {
        trace_mean_destroy(m);
        return -ENOMEM;
    }
    *out = m;
    return 0;
}

/* x and mean as [2 n] floats: the weight is real. */
VECTOR_CLONES
static void fold(float *restrict x, float *restrict mean, size_t n, float weight)
{
    for (size_t i = 0; i < n; i++) {
        float rest = x[i] - mean[i];
        x[i] = rest;
        mean[i] += weight * rest;
    }
}

VECTOR_CLONES
static void fold_least(float *restrict x, float *restrict mean, size_t n, float weight)
{
    for (size_t i = 0; i < n; i += 2) {
        float re = x[i] - mean[i], im = x[i + 1] - mean[i + 1];
        bool less = re * re + im * im < x[i] * x[i] + x[i + 1] * x[i + 1];
        x[i] = less ? re : x[i];
        x[i + 1] = less ? im : x[i + 1];
        mean[i] += weight * re;
        mean[i + 1] += weight * im;
    }
}

uint32_t trace_mean_take(struct trace_mean *m, size_t ping, size_t channel, double share,
                         uint32_t few, float complex *x)
{
    size_t i = ping * m->n_channels + channel, n = m->n_samples;
    float *mean = (float *)(m->mean + i * n);
    uint32_t before = m->taken[i];
    float weight = (float)fmin(fmax(share, 1.0 / ((double)before + 1.0)), 1.0);

    if (before < few)
        fold_least((float *)x, mean, 2 * n, weight);
    else
        fold((float *)x, mean, 2 * n, weight);
    m->taken[i] += before < UINT32_MAX;
    return before;
}

VECTOR_CLONES
static void subtract(float *restrict x, const float *restrict mean, size_t n)
{
    for (size_t i = 0; i < n; i++)
        x[i] -= mean[i];
}

VECTOR_CLONES
static void subtract_least(float *restrict x, const float *restrict mean, size_t n)
{
    for (size_t i = 0; i < n; i += 2) {
        float re = x[i] - mean[i], im = x[i + 1] - mean[i + 1];
        bool less = re * re + im * im < x[i] * x[i] + x[i + 1] * x[i + 1];
        x[i] = less ? re : x[i];
        x[i + 1] = less ? im : x[i + 1];
    }
}

uint32_t trace_mean_subtract(const struct trace_mean *m, size_t ping, size_t channel,
                             uint32_t few, float complex *x)
{
    size_t i = ping * m->n_channels + channel, n = m->n_samples;
    const float *mean = (const float *)(m->mean + i * n);

    if (m->taken[i] < few)
        subtract_least((float *)x, mean, 2 * n);
    else
        subtract((float *)x, mean, 2 * n);
    return m->taken[i];
}

const float complex *trace_mean_of(const struct trace_mean *m, size_t ping)
{
    return m->mean + ping * m->n_channels * m->n_samples;
}

void trace_mean_reset(struct trace_mean *m)
{
    size_t n = m->n_pings * m->n_channels;

    memset(m->mean, 0, n * m->n_samples * sizeof *m->mean);
    memset(m->taken, 0, n * sizeof *m->taken);
}

void trace_mean_destroy(struct trace_mean *m)
{
    if (!m)
        return;
    free(m->mean);
    free(m->taken);
    free(m);
}
