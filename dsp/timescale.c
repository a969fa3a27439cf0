/* SPDX-License-Identifier: MIT */
#include "dsp/timescale.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/vector.h"

#define TAPS INTERPOLATOR_TAPS

struct timescale {
    struct trace_format format;
    const struct interpolator *ip;
    size_t first, end;
    int *base;                       /* [n_samples], the sample before the first tap */
    float *weights;                  /* [2][TAPS][n_samples], of values and of slopes */
    float *cosines, *sines, *slopes; /* [n_samples] */
};

int timescale_create(struct timescale **out, const struct trace_format *format,
                     const struct interpolator *ip)
{
    struct timescale *ts;
    size_t n = format->n_samples;

    if (!out || !n || n > 1u << 26 || !(format->rate_hz > 0.0) || !ip)
        return -EINVAL;
    ts = calloc(1, sizeof(*ts));
    if (!ts)
        return -ENOMEM;
    ts->format = *format;
    ts->ip = ip;
    ts->base = malloc(n * sizeof(*ts->base));
    ts->weights = malloc(2 * TAPS * n * sizeof(*ts->weights));
    ts->cosines = malloc(n * sizeof(*ts->cosines));
    ts->sines = malloc(n * sizeof(*ts->sines));
    ts->slopes = malloc(n * sizeof(*ts->slopes));
    if (!ts->base || !ts->weights || !ts->cosines || !ts->sines || !ts->slopes) {
        timescale_destroy(ts);
        return -ENOMEM;
    }
    timescale_set(ts, 0.0);
    *out = ts;
    return 0;
}

static void set_weights(struct timescale *ts, size_t n, double fraction)
{
    float w[2 * TAPS];

    interpolator_weights(ts->ip, fraction, w);
    for (size_t q = 0; q < 2 * TAPS; q++)
        ts->weights[q * ts->format.n_samples + n] = w[q];
}

/* The phase is linear in time: it is turned on from sample to sample, in double. */
void timescale_set(struct timescale *ts, double stretch)
{
    const struct trace_format *f = &ts->format;
    double shrink = 1.0 / (1.0 + stretch), start = f->t0_s * f->rate_hz;
    double turn = 2.0 * M_PI * f->carrier_hz * (shrink - 1.0);
    double re = cos(turn * f->t0_s), im = sin(turn * f->t0_s);
    double step_re = cos(turn / f->rate_hz), step_im = sin(turn / f->rate_hz);

    ts->first = f->n_samples;
    ts->end = 0;
    for (size_t n = 0; n < f->n_samples; n++) {
        double u = (start + (double)n) * shrink, at = u - start, below = floor(at);
        ts->base[n] = (int)below - INTERPOLATOR_BEFORE;
        if (ts->base[n] >= 0 && ts->base[n] + TAPS <= (int)f->n_samples) {
            ts->first = n < ts->first ? n : ts->first;
            ts->end = n + 1;
        }
        set_weights(ts, n, at - below);
        ts->cosines[n] = (float)re;
        ts->sines[n] = (float)im;
        ts->slopes[n] = (float)(-u * shrink);
        double next = re * step_re - im * step_im;
        im = re * step_im + im * step_re;
        re = next;
    }
    if (ts->first > ts->end)
        ts->first = ts->end;
}

void timescale_range(const struct timescale *ts, size_t *first, size_t *end)
{
    *first = ts->first;
    *end = ts->end;
}

const float *timescale_cosines(const struct timescale *ts)
{
    return ts->cosines;
}

const float *timescale_sines(const struct timescale *ts)
{
    return ts->sines;
}

const float *timescale_slopes(const struct timescale *ts)
{
    return ts->slopes;
}

/* weights: [TAPS][stride] */
VECTOR_CLONES static void interpolate(const float *restrict weights, size_t stride,
                                      const float *restrict x, size_t n,
                                      float *restrict y)
{
    for (size_t i = 0; i < n; i++) {
        float sum = 0.0f;
        for (size_t q = 0; q < TAPS; q++)
            sum += weights[q * stride + i] * x[i + q];
        y[i] = sum;
    }
}

void timescale_execute(const struct timescale *ts, const float *x, float *restrict value,
                       float *restrict slope)
{
    size_t stride = ts->format.n_samples;
    const float *slope_weights = ts->weights + TAPS * stride;

    /* In runs in which the taps move on by a sample for each sample. */
    for (size_t n = ts->first, end; n < ts->end; n = end) {
        const float *taps = x + ts->base[n];
        for (end = n + 1; end < ts->end && ts->base[end] - ts->base[n] == (int)(end - n);)
            end++;
        interpolate(ts->weights + n, stride, taps, end - n, value + n);
        if (slope)
            interpolate(slope_weights + n, stride, taps, end - n, slope + n);
    }
}

void timescale_destroy(struct timescale *ts)
{
    if (!ts)
        return;
    free(ts->base);
    free(ts->weights);
    free(ts->cosines);
    free(ts->sines);
    free(ts->slopes);
    free(ts);
}
