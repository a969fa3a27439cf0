#include "dsp/trace_mean.h"

#include <errno.h>
#include <math.h>
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
static void fold(float *restrict x, float *restrict mean, size_t n, float weight,
                 float part)
{
    for (size_t i = 0; i < n; i++) {
        float rest = x[i] - mean[i];
        x[i] -= part * mean[i];
        mean[i] += weight * rest;
    }
}

uint32_t trace_mean_take(struct trace_mean *m, size_t ping, size_t channel, double share,
                         uint32_t least, float complex *x)
{
    size_t i = ping * m->n_channels + channel;
    uint32_t before = m->taken[i];
    double weight = fmax(share, 1.0 / ((double)before + 1.0));

    fold((float *)x, (float *)(m->mean + i * m->n_samples), 2 * m->n_samples,
         (float)fmin(weight, 1.0), before < least ? 0.0f : 1.0f);
    m->taken[i] += before < UINT32_MAX;
    return before;
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
