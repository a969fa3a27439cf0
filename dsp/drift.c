/* SPDX-License-Identifier: MIT */
#include "dsp/drift.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/timescale.h"
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

#define MAX_STEPS 5

/* What is left of the background even at the right stretch (dsp/timescale.h), in power.
 */
#define MODEL_ERROR 1e-5

/* Chance correlation of two noises stays below this many deviations, over the grid too.
 */
#define SIGNIFICANT 6.0

/* Largest phase, in radians at the band's top and the gate's end, that is not worth an
 * interpolation: -60 dB. */
#define UNNOTICED_PHASE 1e-3

enum sum { FIT, SLOPE, LEFT, MATCH, BACKGROUND, SCENE, N_SUMS };

struct drift {
    struct trace_format format;
    size_t n_channels;
    double occupancy, unnoticed;
    struct interpolator *ip;
    struct timescale *ts;
    struct drift_search *search;
    float *storage; /* of the planes */
    struct drift_planes planes;
    size_t n_heard; /* channels in them that are not masked */
    float *value_re, *value_im, *slope_re, *slope_im; /* [n_samples] */
    float *sums;                                      /* [N_SUMS][n_samples] */
};

static bool config_is_valid(const struct drift_config *c)
{
    const struct trace_format *f = &c->format;

    return c->n_channels && f->n_samples && f->n_samples <= 1u << 26 &&
           isfinite(f->t0_s) && f->t0_s >= 0.0 && isfinite(f->rate_hz) &&
           f->rate_hz > 0.0 && isfinite(f->carrier_hz) && c->band_hz[1] > c->band_hz[0] &&
           c->band_hz[0] >= 0.0;
}

static int allocate(struct drift *d)
{
    size_t n = d->format.n_samples, padding = drift_search_padding(d->search);
    size_t stride = n + 2 * padding, size, all;
    float *scratch;

    if (__builtin_mul_overflow(d->n_channels, stride, &size) ||
        __builtin_mul_overflow(size, 4 * sizeof(float), &all))
        return -ENOMEM;
    d->storage = calloc(size, 4 * sizeof(*d->storage));
    scratch = malloc((4 + N_SUMS) * n * sizeof(*scratch));
    d->value_re = scratch;
    if (!d->storage || !scratch)
        return -ENOMEM;
    d->planes = (struct drift_planes){.n_channels = d->n_channels,
                                      .stride = stride,
                                      .background_re = d->storage + padding,
                                      .background_im = d->storage + size + padding,
                                      .scene_re = d->storage + 2 * size + padding,
                                      .scene_im = d->storage + 3 * size + padding};
    d->value_im = scratch + n;
    d->slope_re = scratch + 2 * n;
    d->slope_im = scratch + 3 * n;
    d->sums = scratch + 4 * n;
    return 0;
}

int drift_create(struct drift **out, const struct drift_config *cfg)
{
    struct drift *d;
    int err;

    if (!out || !cfg || !config_is_valid(cfg))
        return -EINVAL;
    d = calloc(1, sizeof(*d));
    if (!d)
        return -ENOMEM;
    d->format = cfg->format;
    d->n_channels = cfg->n_channels;
    d->occupancy = (cfg->band_hz[1] - cfg->band_hz[0]) / cfg->format.rate_hz;
    d->unnoticed = UNNOTICED_PHASE /
                   (2.0 * M_PI * cfg->band_hz[1] *
                    (d->format.t0_s + (double)d->format.n_samples / d->format.rate_hz));
    err = interpolator_create(&d->ip, d->occupancy);
    if (!err)
        err = timescale_create(&d->ts, &d->format, d->ip);
    if (!err)
        err = drift_search_create(&d->search, &d->format, cfg->band_hz[1],
                                  DRIFT_MAX_STRETCH, d->ip);
    if (!err)
        err = allocate(d);
    if (err)
        drift_destroy(d);
    else
        *out = d;
    return err;
}

VECTOR_CLONES static void split(const float complex *restrict z, size_t n,
                                float *restrict re, float *restrict im)
{
    const float *x = (const float *)z;

    for (size_t i = 0; i < n; i++) {
        re[i] = x[2 * i];
        im[i] = x[2 * i + 1];
    }
}

static void load(struct drift *d, const float complex *background,
                 const float complex *scene, const bool *masked)
{
    const struct drift_planes *p = &d->planes;
    size_t n = d->format.n_samples;

    d->n_heard = 0;
    for (size_t i = 0; i < d->n_channels; i++) {
        size_t at = i * p->stride;
        split(background + i * n, n, p->background_re + at, p->background_im + at);
        split(scene + i * n, n, p->scene_re + at, p->scene_im + at);
        if (!masked || !masked[i]) {
            d->n_heard++;
            continue;
        }
        memset(p->background_re + at, 0, n * sizeof(float));
        memset(p->background_im + at, 0, n * sizeof(float));
        memset(p->scene_re + at, 0, n * sizeof(float));
        memset(p->scene_im + at, 0, n * sizeof(float));
    }
}

struct channel { /* one channel, at the first sample of the range */
    const float *scene_re, *scene_im;
    const float *value_re, *value_im, *slope_re, *slope_im; /* background at u */
    const float *cosines, *sines, *slopes;                  /* of the time scale */
    float carrier;                                          /* radians per sample */
};

/* Per sample: squared derivative of the stretched background by the stretch, its product
 * with what is left, powers and product of the rest.  The scene is turned instead of the
 * background, which saves turning the derivative. */
VECTOR_CLONES static void accumulate(const struct channel *c, size_t n,
                                     float *restrict fit, float *restrict slope,
                                     float *restrict left, float *restrict match,
                                     float *restrict background, float *restrict scene)
{
    for (size_t i = 0; i < n; i++) {
        float sr = c->scene_re[i] * c->cosines[i] + c->scene_im[i] * c->sines[i];
        float si = c->scene_im[i] * c->cosines[i] - c->scene_re[i] * c->sines[i];
        float br = c->value_re[i], bi = c->value_im[i];
        float dr = c->slopes[i] * (c->slope_re[i] - c->carrier * bi);
        float di = c->slopes[i] * (c->slope_im[i] + c->carrier * br);
        float rr = sr - br, ri = si - bi;
        fit[i] += dr * dr + di * di;
        slope[i] += dr * rr + di * ri;
        left[i] += rr * rr + ri * ri;
        match[i] += br * sr + bi * si;
        background[i] += br * br + bi * bi;
        scene[i] += sr * sr + si * si;
    }
}

/* The sums of all channels at a stretch. */
static void linearise(struct drift *d, double stretch, size_t *first, size_t *end)
{
    size_t n = d->format.n_samples;

    timescale_set(d->ts, stretch);
    timescale_range(d->ts, first, end);
    memset(d->sums, 0, N_SUMS * n * sizeof(*d->sums));
    for (size_t i = 0; i < d->n_channels; i++) {
        const struct drift_planes *p = &d->planes;
        size_t at = i * p->stride, f = *first;
        timescale_execute(d->ts, p->background_re + at, d->value_re, d->slope_re);
        timescale_execute(d->ts, p->background_im + at, d->value_im, d->slope_im);
        const struct channel c = {
            .scene_re = p->scene_re + at + f,
            .scene_im = p->scene_im + at + f,
            .value_re = d->value_re + f,
            .value_im = d->value_im + f,
            .slope_re = d->slope_re + f,
            .slope_im = d->slope_im + f,
            .cosines = timescale_cosines(d->ts) + f,
            .sines = timescale_sines(d->ts) + f,
            .slopes = timescale_slopes(d->ts) + f,
            .carrier = (float)(2.0 * M_PI * d->format.carrier_hz / d->format.rate_hz),
        };
        float *sums = d->sums + f;
        accumulate(&c, *end - f, sums + FIT * n, sums + SLOPE * n, sums + LEFT * n,
                   sums + MATCH * n, sums + BACKGROUND * n, sums + SCENE * n);
    }
}

struct step {
    double change;   /* of the stretch */
    double variance; /* of the stretch after it; INFINITY: nothing to go by */
};

/* One Gauss-Newton step.  A block's noise is what is left there.  An oversampled trace's
 * samples are not independent, which makes each sum's variance 1 / occupancy of what it
 * would be.  What chance gives is told from a background that is there by the weighted
 * match, which is near 0 for noise alone. */
static struct step solve(const struct drift *d, size_t first, size_t end)
{
    size_t n = d->format.n_samples;
    double slope = 0.0, fit = 0.0, match = 0.0, chance = 0.0;

    for (size_t at = first; at < end; at += DRIFT_BLOCK) {
        size_t stop = at + DRIFT_BLOCK < end ? at + DRIFT_BLOCK : end;
        double sum[N_SUMS] = {0}, count = (double)((stop - at) * d->n_heard);
        for (size_t s = 0; s < N_SUMS; s++)
            for (size_t i = at; i < stop; i++)
                sum[s] += d->sums[s * n + i];
        double noise = sum[LEFT] + MODEL_ERROR * sum[BACKGROUND];
        if (!(noise > 0.0) || !(sum[BACKGROUND] > 0.0))
            continue;
        double heard = fmin(fmax(sum[MATCH] / sum[BACKGROUND], 0.0), 1.0);
        double w = count / noise;
        slope += heard * w * sum[SLOPE];
        fit += heard * heard * w * sum[FIT];
        match += w * sum[MATCH];
        chance += w * w * sum[BACKGROUND] * sum[SCENE] / count;
    }
    if (!(fit > 0.0) || match < SIGNIFICANT * sqrt(chance / d->occupancy))
        return (struct step){0.0, INFINITY};
    return (struct step){slope / fit, 1.0 / (d->occupancy * fit)};
}

void drift_measure(struct drift *d, const float complex *background,
                   const float complex *scene, const bool *masked,
                   struct drift_measurement *out)
{
    struct step step = {0.0, INFINITY};

    load(d, background, scene, masked);
    double stretch = drift_search_best(d->search, &d->planes);
    for (int i = 0; i < MAX_STEPS; i++) {
        size_t first, end;
        linearise(d, stretch, &first, &end);
        step = solve(d, first, end);
        stretch =
            fmin(fmax(stretch + step.change, -DRIFT_MAX_STRETCH), DRIFT_MAX_STRETCH);
        if (step.change * step.change < 0.01 * step.variance)
            break;
    }
    out->stretch = isfinite(step.variance) ? stretch : 0.0;
    out->variance = step.variance;
}

VECTOR_CLONES static void subtract(const float *restrict re, const float *restrict im,
                                   const float *restrict c, const float *restrict s,
                                   size_t n, float *restrict z)
{
    for (size_t i = 0; i < n; i++) {
        z[2 * i] -= re[i] * c[i] - im[i] * s[i];
        z[2 * i + 1] -= re[i] * s[i] + im[i] * c[i];
    }
}

bool drift_subtract(struct drift *d, double stretch, const float complex *background,
                    float complex *scene)
{
    size_t n = d->format.n_samples, first, end;

    if (fabs(stretch) < d->unnoticed) {
        for (size_t i = 0; i < d->n_channels * n; i++)
            scene[i] -= background[i];
        return false;
    }
    timescale_set(d->ts, stretch);
    timescale_range(d->ts, &first, &end);
    for (size_t i = 0; i < d->n_channels; i++) {
        float *re = d->planes.background_re, *im = d->planes.background_im;
        split(background + i * n, n, re, im);
        timescale_execute(d->ts, re, d->value_re, NULL);
        timescale_execute(d->ts, im, d->value_im, NULL);
        memset(scene + i * n, 0, first * sizeof(*scene));
        memset(scene + i * n + end, 0, (n - end) * sizeof(*scene));
        subtract(d->value_re + first, d->value_im + first,
                 timescale_cosines(d->ts) + first, timescale_sines(d->ts) + first,
                 end - first, (float *)(scene + i * n + first));
    }
    return true;
}

void drift_destroy(struct drift *d)
{
    if (!d)
        return;
    interpolator_destroy(d->ip);
    timescale_destroy(d->ts);
    drift_search_destroy(d->search);
    free(d->storage);
    free(d->value_re);
    free(d);
}

#define PRIOR 2e-3
#define STEP  2e-5 /* between pings, 0.01 K: other paths, and time */

void drift_track_start(struct drift_track *t)
{
    *t = (struct drift_track){0.0, PRIOR * PRIOR};
}

double drift_track_update(struct drift_track *t, const struct drift_measurement *m)
{
    t->variance = fmin(t->variance + STEP * STEP, PRIOR * PRIOR);
    if (isfinite(m->variance)) {
        double gain = t->variance / (t->variance + m->variance);
        t->stretch += gain * (m->stretch - t->stretch);
        t->variance *= 1.0 - gain;
    }
    return fmin(fmax(t->stretch, -DRIFT_MAX_STRETCH), DRIFT_MAX_STRETCH);
}
