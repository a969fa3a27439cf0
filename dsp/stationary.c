/* SPDX-License-Identifier: MIT */
#include "dsp/stationary.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/fft.h"
#include "dsp/rank.h"

#define SEGMENTS   8    /* of a trace */
#define LEAST_BINS 16   /* of a segment's spectrum, to tell parts apart */
#define LEAST_SURE 8    /* traces: of fewer their standard error is not known */
#define SURE       6.0  /* standard errors that the loudest segment is over the middle */
#define LOUDER     1.25 /* and as many times as loud */
#define EVEN       2.0  /* times as loud at most is noise */
#define GAP        4    /* parts from echoes to echoes */

struct stationary {
    size_t n, n_used, n_parts; /* samples and bins of a segment */
    size_t n_traces;
    float *window;   /* [n] */
    float *in, *out; /* [n] complex */
    fftwf_plan plan;
    double power[SEGMENTS][STATIONARY_PARTS]; /* of a trace */
    double sum[SEGMENTS][STATIONARY_PARTS];   /* of shares, over traces */
    double square[SEGMENTS][STATIONARY_PARTS];
};

int stationary_create(struct stationary **out, size_t n_samples, bool real)
{
    size_t n = n_samples / SEGMENTS, n_used = real ? n / 2 : n;

    *out = NULL;
    if (n_used < LEAST_BINS)
        return -EINVAL;
    struct stationary *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    s->n = n;
    s->n_used = n_used;
    s->n_parts = n_used < STATIONARY_PARTS ? n_used : STATIONARY_PARTS;
    s->window = malloc(n * sizeof *s->window);
    s->in = fftwf_malloc(2 * n * sizeof *s->in);
    s->out = fftwf_malloc(2 * n * sizeof *s->out);
    if (s->in && s->out)
        s->plan = fft_plan(n, s->in, s->out, FFTW_FORWARD);
    if (!s->window || !s->plan) {
        stationary_destroy(s);
        return -ENOMEM;
    }
    /* Hann's keeps what is loud in one part out of the others. */
    for (size_t i = 0; i < n; i++)
        s->window[i] =
            (float)(0.5 - 0.5 * cos(2.0 * M_PI * ((double)i + 0.5) / (double)n));
    *out = s;
    return 0;
}

size_t stationary_parts(const struct stationary *s)
{
    return s->n_parts;
}

/* Silence is even. */
static void add_shares(struct stationary *s)
{
    for (size_t q = 0; q < s->n_parts; q++) {
        double all = 0.0;
        for (size_t g = 0; g < SEGMENTS; g++)
            all += s->power[g][q];
        for (size_t g = 0; g < SEGMENTS; g++) {
            double share = all > 0.0 ? s->power[g][q] / all : 1.0 / SEGMENTS;
            s->sum[g][q] += share;
            s->square[g][q] += share * share;
        }
    }
    s->n_traces++;
}

void stationary_take(struct stationary *s, const float complex *x, size_t step)
{
    for (size_t g = 0; g < SEGMENTS; g++) {
        const float complex *from = x + g * s->n * step;
        for (size_t i = 0; i < s->n; i++) {
            s->in[2 * i] = s->window[i] * crealf(from[i * step]);
            s->in[2 * i + 1] = s->window[i] * cimagf(from[i * step]);
        }
        fftwf_execute(s->plan);
        for (size_t q = 0; q < s->n_parts; q++) {
            size_t to = (q + 1) * s->n_used / s->n_parts;
            double power = 0.0;
            for (size_t b = q * s->n_used / s->n_parts; b < to; b++)
                power += (double)s->out[2 * b] * (double)s->out[2 * b] +
                         (double)s->out[2 * b + 1] * (double)s->out[2 * b + 1];
            s->power[g][q] = power;
        }
    }
    add_shares(s);
}

static enum stationary_kind judge(const struct stationary *s, size_t q)
{
    double mean[SEGMENTS], n = (double)s->n_traces;
    size_t loudest = 0;

    for (size_t g = 0; g < SEGMENTS; g++)
        if (s->sum[g][q] > s->sum[loudest][q])
            loudest = g;
    for (size_t g = 0; g < SEGMENTS; g++)
        mean[g] = s->sum[g][q] / n;
    double most = mean[loudest], middle = rank_median(mean, SEGMENTS);
    double variance = fmax(s->square[loudest][q] / n - most * most, 0.0);
    if (s->n_traces >= LEAST_SURE && most > LOUDER * middle &&
        most - middle > SURE * sqrt(variance / (n - 1.0)))
        return STATIONARY_ECHOES;
    return most <= EVEN * middle ? STATIONARY_NOISE : STATIONARY_UNCLEAR;
}

void stationary_judge(const struct stationary *s, enum stationary_kind *kind)
{
    size_t last = s->n_parts; /* none */

    for (size_t q = 0; q < s->n_parts; q++)
        kind[q] = s->n_traces > 1 ? judge(s, q) : STATIONARY_UNCLEAR;
    for (size_t q = 0; q < s->n_parts; q++) {
        if (kind[q] != STATIONARY_ECHOES)
            continue;
        for (size_t gap = last + 1; last < q && q - last <= GAP && gap < q; gap++)
            kind[gap] = STATIONARY_ECHOES;
        last = q;
    }
}

void stationary_destroy(struct stationary *s)
{
    if (!s)
        return;
    fftwf_destroy_plan(s->plan);
    fftwf_free(s->in);
    fftwf_free(s->out);
    free(s->window);
    free(s);
}
