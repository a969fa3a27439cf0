#include "dsp/drift_search.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/vector.h"

#define TAPS INTERPOLATOR_TAPS
/* Steps of the stretch for each turn of the highest frequency at the last delay. */
#define STEPS_PER_TURN 8.0

struct drift_search {
    struct trace_format format;
    const struct interpolator *ip;
    double max_stretch;
    size_t n_blocks, reach; /* lags -reach..reach */
    size_t n_steps;         /* to either side */
    float *re, *im;         /* [n_blocks][2 reach + 1] */
    double *sums;           /* [2 n_steps + 1], scratch of best */
};

int drift_search_create(struct drift_search **out, const struct trace_format *format,
                        double highest_hz, double max_stretch,
                        const struct interpolator *ip)
{
    double last_s = format->t0_s + (double)format->n_samples / format->rate_hz;
    double shift = last_s * format->rate_hz * max_stretch / (1.0 - max_stretch);
    struct drift_search *ds;

    if (!(shift < 1e3) || !(last_s > 0.0) || !(highest_hz > 0.0))
        return -EINVAL;
    ds = calloc(1, sizeof(*ds));
    if (!ds)
        return -ENOMEM;
    ds->format = *format;
    ds->ip = ip;
    ds->max_stretch = max_stretch;
    ds->n_blocks = (format->n_samples + DRIFT_BLOCK - 1) / DRIFT_BLOCK;
    ds->reach = (size_t)ceil(shift) + TAPS;
    ds->n_steps = 1 + (size_t)(max_stretch * last_s * highest_hz * STEPS_PER_TURN);
    ds->re = calloc(ds->n_blocks * (2 * ds->reach + 1), sizeof(*ds->re));
    ds->im = calloc(ds->n_blocks * (2 * ds->reach + 1), sizeof(*ds->im));
    ds->sums = malloc((2 * ds->n_steps + 1) * sizeof(*ds->sums));
    if (!ds->re || !ds->im || !ds->sums) {
        drift_search_destroy(ds);
        return -ENOMEM;
    }
    *out = ds;
    return 0;
}

size_t drift_search_padding(const struct drift_search *ds)
{
    return ds->reach + DRIFT_BLOCK;
}

/* Sum over a block's samples and all channels of scene conj(background) at one lag. */
VECTOR_CLONES static void correlate(const struct drift_planes *p, size_t block, long lag,
                                    float *re, float *im)
{
    vector16 sum_re = {0}, sum_im = {0};

    for (size_t i = 0; i < p->n_channels; i++) {
        size_t at = i * p->stride + block * DRIFT_BLOCK;
        for (size_t v = 0; v < DRIFT_BLOCK; v += VECTOR_LANES) {
            vector16 sr = *(const vector16 *)(p->scene_re + at + v);
            vector16 si = *(const vector16 *)(p->scene_im + at + v);
            vector16 br = *(const vector16 *)(p->background_re + at + v + lag);
            vector16 bi = *(const vector16 *)(p->background_im + at + v + lag);
            sum_re += sr * br + si * bi;
            sum_im += si * br - sr * bi;
        }
    }
    *re = *im = 0.0f;
    for (size_t i = 0; i < VECTOR_LANES; i++) {
        *re += sum_re[i];
        *im += sum_im[i];
    }
}

static double block_centre(const struct drift_search *ds, size_t k) /* in samples */
{
    return ds->format.t0_s * ds->format.rate_hz + ((double)k + 0.5) * DRIFT_BLOCK;
}

/* Early blocks are shifted less. */
static size_t lags_of_block(const struct drift_search *ds, size_t k)
{
    size_t lags = (size_t)(ds->max_stretch * block_centre(ds, k)) + 1 + TAPS / 2;
    return lags < ds->reach ? lags : ds->reach;
}

/* Adds one block to the sums of all stretches.  Its delay d = t - u is proportional to
 * `shrink`, so that the carrier's phase turns by the same angle each step. */
static void add_block(const struct drift_search *ds, size_t k)
{
    const float *re = ds->re + k * (2 * ds->reach + 1) + ds->reach;
    const float *im = ds->im + k * (2 * ds->reach + 1) + ds->reach;
    double step = ds->max_stretch / (double)ds->n_steps * block_centre(ds, k);
    double turn = 2.0 * M_PI * ds->format.carrier_hz / ds->format.rate_hz * step;
    double c = cos(turn), s = sin(turn);
    double pr = cos(turn * (double)ds->n_steps), pi = -sin(turn * (double)ds->n_steps);

    for (size_t g = 0; g <= 2 * ds->n_steps; g++) {
        double at = step * ((double)ds->n_steps - (double)g), below = floor(at);
        const float *r = re + (int)below - INTERPOLATOR_BEFORE;
        const float *i = im + (int)below - INTERPOLATOR_BEFORE;
        float w[2 * TAPS], sum_re = 0.0f, sum_im = 0.0f;

        interpolator_weights(ds->ip, at - below, w);
        for (size_t q = 0; q < TAPS; q++) {
            sum_re += w[q] * r[q];
            sum_im += w[q] * i[q];
        }
        ds->sums[g] += sum_re * pr - sum_im * pi;
        double next = pr * c - pi * s;
        pi = pr * s + pi * c;
        pr = next;
    }
}

double drift_search_best(struct drift_search *ds, const struct drift_planes *planes)
{
    size_t best = ds->n_steps, n_lags = 2 * ds->reach + 1;

    for (size_t g = 0; g <= 2 * ds->n_steps; g++)
        ds->sums[g] = 0.0;
    for (size_t k = 0; k < ds->n_blocks; k++) {
        size_t needed = lags_of_block(ds, k);
        for (size_t lag = ds->reach - needed; lag <= ds->reach + needed; lag++)
            correlate(planes, k, (long)lag - (long)ds->reach, &ds->re[k * n_lags + lag],
                      &ds->im[k * n_lags + lag]);
        add_block(ds, k);
    }
    for (size_t g = 0; g <= 2 * ds->n_steps; g++)
        if (ds->sums[g] > ds->sums[best])
            best = g;
    double shrink = ds->max_stretch * ((double)best / (double)ds->n_steps - 1.0);
    return shrink / (1.0 - shrink);
}

void drift_search_destroy(struct drift_search *ds)
{
    if (!ds)
        return;
    free(ds->re);
    free(ds->im);
    free(ds->sums);
    free(ds);
}
