/* SPDX-License-Identifier: MIT */
#include "dsp/eigencanceler.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TURNS 12 /* of the power method: of a half 0.5^12 of the rest is left */

struct eigencanceler {
    struct eigencanceler_config cfg;
    bool *known;                   /* [n_speakers] */
    float complex *before;         /* [n_speakers][n_channels][n_samples] */
    float complex *fresh;          /* [n_channels][n_samples] */
    double complex *covariance;    /* [n_channels][n_channels], over the pings */
    double complex *left;          /* the same, without what was taken out */
    double complex *vector, *next; /* [n_channels] */
    float complex *sum;            /* [n_samples] */
};

int eigencanceler_create(struct eigencanceler **out,
                         const struct eigencanceler_config *cfg)
{
    size_t n = cfg->n_channels, size = n * cfg->n_samples;

    *out = NULL;
    if (!cfg->n_speakers || !size)
        return -EINVAL;
    struct eigencanceler *e = calloc(1, sizeof *e);
    if (!e)
        return -ENOMEM;
    e->cfg = *cfg;
    e->known = calloc(cfg->n_speakers, sizeof *e->known);
    e->before = calloc(cfg->n_speakers * size, sizeof *e->before);
    e->fresh = calloc(size, sizeof *e->fresh);
    e->covariance = calloc(n * n, sizeof *e->covariance);
    e->left = calloc(n * n, sizeof *e->left);
    e->vector = calloc(n, sizeof *e->vector);
    e->next = calloc(n, sizeof *e->next);
    e->sum = calloc(cfg->n_samples, sizeof *e->sum);
    if (!e->known || !e->before || !e->fresh || !e->covariance || !e->left ||
        !e->vector || !e->next || !e->sum) {
        eigencanceler_destroy(e);
        return -ENOMEM;
    }
    *out = e;
    return 0;
}

void eigencanceler_destroy(struct eigencanceler *e)
{
    if (!e)
        return;
    free(e->known);
    free(e->before);
    free(e->fresh);
    free(e->covariance);
    free(e->left);
    free(e->vector);
    free(e->next);
    free(e->sum);
    free(e);
}

static void add_covariance(struct eigencanceler *e)
{
    size_t n = e->cfg.n_channels;

    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b <= a; b++) {
            const float *x = (const float *)(e->fresh + a * e->cfg.n_samples);
            const float *y = (const float *)(e->fresh + b * e->cfg.n_samples);
            float re = 0, im = 0;
            for (size_t i = 0; i < 2 * e->cfg.n_samples; i += 2) {
                re += x[i] * y[i] + x[i + 1] * y[i + 1];
                im += x[i + 1] * y[i] - x[i] * y[i + 1];
            }
            double complex *ab = &e->covariance[a * n + b];
            *ab = EIGENCANCELER_KEEPS * *ab + re + I * im;
            e->covariance[b * n + a] = conj(*ab);
        }
}

/* The first eigenvector of what is left, by the power method from the channel that has
 * most; its eigenvalue. */
static double find_direction(struct eigencanceler *e)
{
    size_t n = e->cfg.n_channels, most = 0;
    double value = 0;

    for (size_t a = 0; a < n; a++)
        if (creal(e->left[a * n + a]) > creal(e->left[most * n + most]))
            most = a;
    for (size_t a = 0; a < n; a++)
        e->next[a] = e->left[a * n + most];
    for (int turn = 0; turn <= TURNS; turn++) {
        value = 0;
        for (size_t a = 0; a < n; a++)
            value += creal(e->next[a] * conj(e->next[a]));
        value = sqrt(value);
        if (!(value > 0))
            return 0;
        for (size_t a = 0; a < n; a++)
            e->vector[a] = e->next[a] / value;
        for (size_t a = 0; a < n; a++) {
            e->next[a] = 0;
            for (size_t b = 0; b < n; b++)
                e->next[a] += e->left[a * n + b] * e->vector[b];
        }
    }
    return value;
}

static void project_traces(struct eigencanceler *e, float complex *traces)
{
    memset(e->sum, 0, e->cfg.n_samples * sizeof *e->sum);
    for (size_t a = 0; a < e->cfg.n_channels; a++) {
        float complex v = (float complex)conj(e->vector[a]);
        for (size_t i = 0; i < e->cfg.n_samples; i++)
            e->sum[i] += v * traces[a * e->cfg.n_samples + i];
    }
    for (size_t a = 0; a < e->cfg.n_channels; a++) {
        float complex v = (float complex)e->vector[a];
        for (size_t i = 0; i < e->cfg.n_samples; i++)
            traces[a * e->cfg.n_samples + i] -= v * e->sum[i];
    }
}

static size_t cancel(struct eigencanceler *e, float complex *traces)
{
    size_t n = e->cfg.n_channels, taken = 0;

    memcpy(e->left, e->covariance, n * n * sizeof *e->left);
    for (; taken < EIGENCANCELER_MOST; taken++) {
        double all = 0, value = find_direction(e);
        for (size_t a = 0; a < n; a++)
            all += creal(e->left[a * n + a]);
        if (!(value > EIGENCANCELER_SHARE * all))
            break;
        project_traces(e, traces);
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++)
                e->left[a * n + b] -= value * e->vector[a] * conj(e->vector[b]);
    }
    return taken;
}

size_t eigencanceler_execute(struct eigencanceler *e, size_t speaker, bool cancels,
                             float complex *traces)
{
    size_t n = e->cfg.n_channels, size = n * e->cfg.n_samples;
    float complex *before = e->before + speaker * size;
    bool known = e->known[speaker];

    if (!cancels)
        memset(e->covariance, 0, n * n * sizeof *e->covariance);
    for (size_t i = 0; i < size && cancels; i++)
        e->fresh[i] = traces[i] - before[i];
    memcpy(before, traces, size * sizeof *before);
    e->known[speaker] = true;
    if (!cancels)
        return 0;
    if (known)
        add_covariance(e);
    return cancel(e, traces);
}
