/* SPDX-License-Identifier: MIT */
#include "recon/inverse/sparse_operator.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "dsp/window.h"
#include "recon/imaging/fold.h"

#define FRACTIONS 512  /* steps of the pulse's table between two samples */
#define REACH     4.0  /* of the pulse, over 1 / band: -46 dB and falling */
#define MAX_HALF  16   /* samples of it on each side, at most */
#define LAGS      1024 /* steps of its autocorrelation's table between two samples */
#define RUNS      16 /* sums are split in so many parts, however many threads there are */

struct run {                /* one a part of the sums */
    float *sum_re, *sum_im; /* [max_points] */
    float
        *window; /* [2][n_samples + 2 * half] of one trace: re, im; or [3][max_points] */
};

struct sparse_operator {
    struct geometry geometry;
    struct trace_format format;
    struct pool *pool;
    size_t pairs, n_traces, max_points, n;
    size_t half;            /* samples of the pulse on each side */
    float *autocorrelation; /* [n_lags] */
    size_t n_lags;
    float *pulse;          /* [FRACTIONS + 1][2 * half] */
    float *traces;         /* [position][speaker][microphone][n_samples] re im */
    bool *live;            /* [position][speaker][microphone] */
    float *weight;         /* square root of what each trace counts */
    uint32_t *cell, *fold; /* [n_traces] its midpoint; [n_cells] live traces of it */
    size_t n_cells;

    /* [position][speakers, microphones][max_points]: delay in samples (of a pair the sum
     * of two), carrier's phasor over it times one over the distance */
    float *delay, *re, *im;
    float *scale; /* [max_points]: makes columns unit length */

    struct run runs[RUNS];

    /* of the call under way */
    float *x_re, *x_im; /* [max_points], scaled */
    float *gram;
    const float *from;
    float *to;
    bool forward, adjoint;
    bool recorded; /* the traces are as recorded, not yet weighted */
};

static inline size_t n_elements(const struct sparse_operator *s)
{
    return s->geometry.n_speakers + s->geometry.n_microphones;
}

/* Samples of a run's window: a trace with the pulse's reach on both sides. */
static inline size_t window_size(const struct sparse_operator *s)
{
    return s->format.n_samples + 2 * s->half;
}

struct pair { /* tables of its speaker and its microphone */
    const float *delay_s, *delay_m, *re_s, *re_m, *im_s, *im_m;
};

static inline struct pair find_pair(const struct sparse_operator *s, size_t k,
                                    size_t pair)
{
    size_t n_m = s->geometry.n_microphones, base = k * n_elements(s);
    size_t j = (base + pair / n_m) * s->max_points;
    size_t i = (base + s->geometry.n_speakers + pair % n_m) * s->max_points;
    return (struct pair){s->delay + j, s->delay + i, s->re + j,
                         s->re + i,    s->im + j,    s->im + i};
}

/* -- create: tables of the pulse, room for the traces -----------------------------------
 */

void sparse_operator_destroy(struct sparse_operator *s)
{
    if (!s)
        return;
    float *const all[] = {s->pulse, s->traces, s->weight, s->delay, s->re,
                          s->im,    s->scale,  s->x_re,   s->x_im,  s->autocorrelation};
    for (size_t a = 0; a < sizeof all / sizeof *all; a++)
        free(all[a]);
    for (size_t r = 0; r < RUNS; r++) {
        free(s->runs[r].sum_re);
        free(s->runs[r].sum_im);
        free(s->runs[r].window);
    }
    free(s->live);
    free(s->cell);
    free(s->fold);
    geometry_clear(&s->geometry);
    free(s);
}

static double sinc(double x)
{
    return fabs(x) < 1e-9 ? 1.0 : sin(M_PI * x) / (M_PI * x);
}

/* Of the Hann pulse, whose spectrum is cos^2: cos^4 in powers of exp(2 pi i f). */
static double hann_autocorrelation(double x)
{
    return sinc(x) + (sinc(x - 1.0) + sinc(x + 1.0)) * 2.0 / 3.0 +
           (sinc(x - 2.0) + sinc(x + 2.0)) / 6.0;
}

/* per_sample: samples in units of 1 / band. */
static void fill_tables(struct sparse_operator *s, double per_sample)
{
    for (size_t f = 0; f <= FRACTIONS; f++) {
        for (size_t k = 0; k < 2 * s->half; k++) {
            double at = (double)k - (double)(s->half - 1) - (double)f / FRACTIONS;
            s->pulse[f * 2 * s->half + k] = (float)window_hann_pulse(at * per_sample);
        }
    }
    for (size_t q = 0; q < s->n_lags; q++)
        s->autocorrelation[q] =
            (float)hann_autocorrelation((double)q / LAGS * per_sample);
}

static int allocate(struct sparse_operator *s)
{
    size_t taps = 2 * s->half, points = s->max_points;
    size_t table = s->geometry.n_positions * n_elements(s) * points;
    struct {
        float **at;
        size_t n;
    } all[] = {{&s->pulse, (FRACTIONS + 1) * taps},
               {&s->traces, 2 * s->n_traces * s->format.n_samples},
               {&s->weight, s->n_traces},
               {&s->delay, table},
               {&s->re, table},
               {&s->im, table},
               {&s->autocorrelation, s->n_lags},
               {&s->scale, points},
               {&s->x_re, points},
               {&s->x_im, points}};
    int err = 0;
    for (size_t a = 0; a < sizeof all / sizeof *all; a++)
        if (!(*all[a].at = calloc(all[a].n, sizeof(float))))
            err = -ENOMEM;
    for (size_t r = 0; r < RUNS; r++) {
        struct run *run = &s->runs[r];
        run->sum_re = malloc(points * sizeof(float));
        run->sum_im = malloc(points * sizeof(float));
        /* also three rows of points, for the Gram matrix */
        size_t window = 2 * window_size(s);
        run->window = calloc(window > 3 * points ? window : 3 * points, sizeof(float));
        if (!run->sum_re || !run->sum_im || !run->window)
            err = -ENOMEM;
    }
    s->live = calloc(s->n_traces, sizeof *s->live);
    s->cell = calloc(s->n_traces, sizeof *s->cell);
    s->fold = calloc(s->n_traces, sizeof *s->fold);
    return s->live && s->cell && s->fold ? err : -ENOMEM;
}

int sparse_operator_create(struct sparse_operator **out, const struct imager_config *cfg,
                           size_t max_points)
{
    struct sparse_operator *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    double band_hz = cfg->band_hz[1] - cfg->band_hz[0];
    s->format = cfg->format;
    s->pool = cfg->pool;
    s->max_points = max_points;
    s->half = (size_t)fmin(ceil(REACH * s->format.rate_hz / band_hz), MAX_HALF);
    s->n_lags = (size_t)ceil(REACH * s->format.rate_hz / band_hz * LAGS);
    int err = geometry_copy(&s->geometry, cfg->geometry);
    if (!err) {
        s->pairs = s->geometry.n_speakers * s->geometry.n_microphones;
        s->n_traces = s->pairs * s->geometry.n_positions;
        err = allocate(s);
    }
    if (!err)
        err = fold_number(&s->geometry, s->cell, &s->n_cells);
    if (err) {
        sparse_operator_destroy(s);
        return err;
    }
    fill_tables(s, band_hz / s->format.rate_hz);
    *out = s;
    return 0;
}

void sparse_operator_add(struct sparse_operator *s, size_t position, size_t speaker,
                         const float complex *traces, const bool *masked)
{
    size_t n_m = s->geometry.n_microphones, n = s->format.n_samples;
    size_t first = position * s->pairs + speaker * n_m;
    for (size_t i = 0; i < n_m; i++) {
        if (masked && masked[i])
            continue;
        memcpy(s->traces + 2 * (first + i) * n, traces + i * n, n * sizeof *traces);
        s->live[first + i] = true;
    }
}

void sparse_operator_reset(struct sparse_operator *s)
{
    memset(s->live, 0, s->n_traces * sizeof *s->live);
}

/* -- points -----------------------------------------------------------------------------
 */

struct places {
    struct sparse_operator *s;
    const double (*at_m)[3];
};

/* Delays and phasors of all elements at one stage position, in double until they are
 * folded to a turn. */
static void place_position(void *ctx, size_t k, size_t thread)
{
    const struct places *p = ctx;
    struct sparse_operator *s = p->s;
    const struct geometry *g = &s->geometry;
    (void)thread;
    for (size_t e = 0; e < n_elements(s); e++) {
        double from[3];
        size_t at = (k * n_elements(s) + e) * s->max_points;
        if (e < g->n_speakers)
            geometry_speaker(g, k, e, from);
        else
            geometry_microphone(g, k, 0, e - g->n_speakers, from);
        for (size_t v = 0; v < s->n; v++) {
            double d[3];
            for (int a = 0; a < 3; a++)
                d[a] = p->at_m[v][a] - from[a];
            double r = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            double delay_s = r / g->sound_speed_m_s;
            double turns = s->format.carrier_hz * delay_s, gain = 1.0 / fmax(r, 1e-3);
            double angle = 2.0 * M_PI * (turns - rint(turns));
            s->delay[at + v] =
                (float)((delay_s - 0.5 * s->format.t0_s) * s->format.rate_hz);
            s->re[at + v] = (float)(gain * cos(angle));
            s->im[at + v] = (float)(-gain * sin(angle));
        }
    }
}

/* Each midpoint counts once. */
static void weigh(struct sparse_operator *s)
{
    memset(s->fold, 0, s->n_cells * sizeof *s->fold);
    for (size_t t = 0; t < s->n_traces; t++)
        s->fold[s->cell[t]] += s->live[t];
    for (size_t t = 0; t < s->n_traces; t++)
        s->weight[t] = s->live[t] ? 1.0f / sqrtf((float)s->fold[s->cell[t]]) : 0.0f;
}

/* Columns of length 1: |p|^2 hardly depends on the fraction, the rest is known. */
static void scale_columns(struct sparse_operator *s)
{
    size_t taps = 2 * s->half, n_s = s->geometry.n_speakers;
    size_t n_m = s->geometry.n_microphones;
    double energy = 0.0;
    for (size_t k = 0; k < taps; k++)
        energy += pow(s->pulse[FRACTIONS / 2 * taps + k], 2.0);
    for (size_t v = 0; v < s->n; v++) {
        double sum = 0.0;
        for (size_t k = 0; k < s->geometry.n_positions; k++) {
            const float *re = s->re + k * n_elements(s) * s->max_points + v;
            const float *im = s->im + k * n_elements(s) * s->max_points + v;
            for (size_t pair = 0; pair < s->pairs; pair++) {
                size_t j = pair / n_m * s->max_points;
                size_t i = (n_s + pair % n_m) * s->max_points;
                double gj = (double)re[j] * re[j] + (double)im[j] * im[j];
                double gi = (double)re[i] * re[i] + (double)im[i] * im[i];
                sum += pow(s->weight[k * s->pairs + pair], 2.0) * gj * gi;
            }
        }
        s->scale[v] = sum > 0.0 ? (float)(1.0 / sqrt(sum * energy)) : 0.0f;
    }
}

void sparse_operator_place(struct sparse_operator *s, size_t n, const double (*at_m)[3])
{
    struct places p = {s, at_m};
    s->n = n < s->max_points ? n : s->max_points;
    weigh(s);
    pool_run(s->pool, s->geometry.n_positions, place_position, &p);
    scale_columns(s);
}

void sparse_operator_keep(struct sparse_operator *s, size_t n, const size_t *which)
{
    for (size_t e = 0; e < s->geometry.n_positions * n_elements(s); e++) {
        size_t at = e * s->max_points;
        for (size_t v = 0; v < n; v++) {
            s->delay[at + v] = s->delay[at + which[v]];
            s->re[at + v] = s->re[at + which[v]];
            s->im[at + v] = s->im[at + which[v]];
        }
    }
    for (size_t v = 0; v < n; v++)
        s->scale[v] = s->scale[which[v]];
    s->n = n;
}

/* -- pairs ------------------------------------------------------------------------------
 */

/* Where the pulse of a point begins in the window (the trace with `half` samples around
 * it), and its shape; false: it misses the trace. */
VECTOR_INLINE int begin(const struct pair *p, size_t v, size_t half, float last,
                        size_t *sample, size_t *fraction)
{
    float at = p->delay_s[v] + p->delay_m[v];
    if (!(at >= 0.0f && at < last))
        return 0;
    size_t q = (size_t)at;
    *sample = q + 1; /* of half - 1 before q, in a window that starts half before */
    *fraction = (size_t)((at - (float)q) * FRACTIONS + 0.5f) * 2 * half;
    return 1;
}

VECTOR_CLONES
static void spread(const struct pair *p, size_t n, const float *x_re, const float *x_im,
                   const float *pulse, size_t half, float last, float weight,
                   float *restrict re, float *restrict im)
{
    for (size_t v = 0; v < n; v++) {
        size_t sample, fraction;
        if ((x_re[v] == 0.0f && x_im[v] == 0.0f) ||
            !begin(p, v, half, last, &sample, &fraction))
            continue;
        float cr = p->re_s[v] * p->re_m[v] - p->im_s[v] * p->im_m[v];
        float ci = p->re_s[v] * p->im_m[v] + p->im_s[v] * p->re_m[v];
        float ar = weight * (cr * x_re[v] - ci * x_im[v]);
        float ai = weight * (cr * x_im[v] + ci * x_re[v]);
        const float *shape = pulse + fraction;
        float *restrict to_re = re + sample, *restrict to_im = im + sample;
        for (size_t k = 0; k < 2 * half; k++) {
            to_re[k] += ar * shape[k];
            to_im[k] += ai * shape[k];
        }
    }
}

VECTOR_CLONES
static void collect(const struct pair *p, size_t n, const float *restrict re,
                    const float *restrict im, const float *pulse, size_t half, float last,
                    float weight, float *restrict sum_re, float *restrict sum_im)
{
    for (size_t v = 0; v < n; v++) {
        size_t sample, fraction;
        if (!begin(p, v, half, last, &sample, &fraction))
            continue;
        const float *shape = pulse + fraction, *from_re = re + sample;
        const float *from_im = im + sample;
        float lanes_re[8] = {0}, lanes_im[8] = {0};
        for (size_t k = 0; k < half / 4 * 8; k += 8)
            for (size_t l = 0; l < 8; l++) {
                lanes_re[l] += from_re[k + l] * shape[k + l];
                lanes_im[l] += from_im[k + l] * shape[k + l];
            }
        for (size_t k = half / 4 * 8; k < 2 * half; k++) {
            lanes_re[k % 8] += from_re[k] * shape[k];
            lanes_im[k % 8] += from_im[k] * shape[k];
        }
        float yr = ((lanes_re[0] + lanes_re[4]) + (lanes_re[1] + lanes_re[5])) +
                   ((lanes_re[2] + lanes_re[6]) + (lanes_re[3] + lanes_re[7]));
        float yi = ((lanes_im[0] + lanes_im[4]) + (lanes_im[1] + lanes_im[5])) +
                   ((lanes_im[2] + lanes_im[6]) + (lanes_im[3] + lanes_im[7]));
        float cr = p->re_s[v] * p->re_m[v] - p->im_s[v] * p->im_m[v];
        float ci = p->re_s[v] * p->im_m[v] + p->im_s[v] * p->re_m[v];
        sum_re[v] += weight * (cr * yr + ci * yi);
        sum_im[v] += weight * (cr * yi - ci * yr);
    }
}

static void split_trace(const float *trace, size_t n, float *re, float *im)
{
    for (size_t q = 0; q < n; q++) {
        re[q] = trace[2 * q];
        im[q] = trace[2 * q + 1];
    }
}

static void do_trace(struct sparse_operator *s, struct run *run, size_t k, size_t pair)
{
    size_t t = k * s->pairs + pair, n = s->format.n_samples;
    float *re = run->window, *im = re + window_size(s), last = (float)(n - 1);
    struct pair p = find_pair(s, k, pair);
    if (s->forward) {
        memset(run->window, 0, 2 * window_size(s) * sizeof(float));
        spread(&p, s->n, s->x_re, s->x_im, s->pulse, s->half, last, s->weight[t], re, im);
        /* what falls before or behind the trace was never recorded */
        memset(re, 0, s->half * sizeof(float));
        memset(im, 0, s->half * sizeof(float));
        memset(re + s->half + n, 0, s->half * sizeof(float));
        memset(im + s->half + n, 0, s->half * sizeof(float));
    } else {
        split_trace(s->from + 2 * t * n, n, re + s->half, im + s->half);
    }
    float weight = s->weight[t] * (s->recorded ? s->weight[t] : 1.0f);
    if (s->adjoint)
        collect(&p, s->n, re, im, s->pulse, s->half, last, weight, run->sum_re,
                run->sum_im);
    else
        for (size_t q = 0; q < n; q++) {
            s->to[2 * (t * n + q)] = re[s->half + q];
            s->to[2 * (t * n + q) + 1] = im[s->half + q];
        }
}

/* Every RUNS-th stage position. */
static void do_run(void *ctx, size_t item, size_t thread)
{
    struct sparse_operator *s = ctx;
    struct run *run = &s->runs[item];
    (void)thread;
    memset(run->sum_re, 0, s->n * sizeof(float));
    memset(run->sum_im, 0, s->n * sizeof(float));
    memset(run->window, 0, 2 * window_size(s) * sizeof(float));
    for (size_t k = item; k < s->geometry.n_positions; k += RUNS)
        for (size_t pair = 0; pair < s->pairs; pair++)
            if (s->weight[k * s->pairs + pair] > 0.0f)
                do_trace(s, run, k, pair);
}

static void load(struct sparse_operator *s, const float *x)
{
    for (size_t v = 0; v < s->n; v++) {
        s->x_re[v] = s->scale[v] * x[2 * v];
        s->x_im[v] = s->scale[v] * x[2 * v + 1];
    }
}

static void sum_runs(const struct sparse_operator *s, float *x)
{
    for (size_t v = 0; v < s->n; v++) {
        double re = 0.0, im = 0.0;
        for (size_t r = 0; r < RUNS; r++) {
            re += (double)s->runs[r].sum_re[v];
            im += (double)s->runs[r].sum_im[v];
        }
        x[2 * v] = (float)(re * s->scale[v]);
        x[2 * v + 1] = (float)(im * s->scale[v]);
    }
}

void sparse_operator_forward(struct sparse_operator *s, const float *x,
                             float complex *traces)
{
    load(s, x);
    s->forward = true;
    s->adjoint = false;
    s->to = (float *)traces;
    memset(traces, 0, s->n_traces * s->format.n_samples * sizeof *traces);
    pool_run(s->pool, RUNS, do_run, s);
}

void sparse_operator_residual(struct sparse_operator *s, const float *x,
                              float complex *residual)
{
    size_t n = 2 * s->format.n_samples;

    sparse_operator_forward(s, x, residual);
    for (size_t t = 0; t < s->n_traces; t++) {
        float *rest = (float *)residual + t * n, over = 0.0f;
        const float *heard = s->traces + t * n;
        if (s->weight[t] > 0.0f)
            over = 1.0f / s->weight[t];
        for (size_t q = 0; q < n; q++)
            rest[q] = s->live[t] ? heard[q] - over * rest[q] : 0.0f;
    }
}

static void adjoint(struct sparse_operator *s, const float *traces, float *x)
{
    s->forward = false;
    s->adjoint = true;
    s->from = traces;
    pool_run(s->pool, RUNS, do_run, s);
    sum_runs(s, x);
}

void sparse_operator_adjoint(struct sparse_operator *s, const float complex *traces,
                             float *x)
{
    adjoint(s, (const float *)traces, x);
}

void sparse_operator_data(struct sparse_operator *s, float *out)
{
    s->recorded = true;
    adjoint(s, s->traces, out);
    s->recorded = false;
}

void sparse_operator_normal(struct sparse_operator *s, const float *x, float *out)
{
    load(s, x);
    s->forward = s->adjoint = true;
    pool_run(s->pool, RUNS, do_run, s);
    sum_runs(s, out);
}

/* -- K' K of a few points as a matrix ---------------------------------------------------
 */

/* Delays and amplitudes of all points in one pair; 0 for those that miss the trace. */
VECTOR_CLONES
static void amplitudes(const struct pair *p, size_t n, const float *restrict scale,
                       float weight, float last, float *restrict at, float *restrict re,
                       float *restrict im)
{
    for (size_t v = 0; v < n; v++) {
        float delay = p->delay_s[v] + p->delay_m[v];
        float gain = delay >= 0.0f && delay < last ? weight * scale[v] : 0.0f;
        at[v] = delay;
        re[v] = gain * (p->re_s[v] * p->re_m[v] - p->im_s[v] * p->im_m[v]);
        im[v] = gain * (p->re_s[v] * p->im_m[v] + p->im_s[v] * p->re_m[v]);
    }
}

/* row += conj(own) R(at - own_at) of all points. */
VECTOR_CLONES
static void correlate(size_t n, const float *restrict at, const float *restrict re,
                      const float *restrict im, size_t own, const float *restrict table,
                      int last_lag, float *restrict row_re, float *restrict row_im)
{
    float own_at = at[own], own_re = re[own], own_im = im[own];
    for (size_t v = 0; v < n; v++) {
        int lag = (int)(fabsf(at[v] - own_at) * LAGS + 0.5f);
        float r = table[lag < last_lag ? lag : last_lag];
        row_re[v] += r * (own_re * re[v] + own_im * im[v]);
        row_im[v] += r * (own_re * im[v] - own_im * re[v]);
    }
}

/* A part of the rows, over all pairs. */
static void gram_rows(void *ctx, size_t item, size_t thread)
{
    struct sparse_operator *s = ctx;
    size_t n = s->n, rows = (n + RUNS - 1) / RUNS, first = item * rows;
    size_t end = first + rows < n ? first + rows : n;
    float *at = s->runs[item].window, *re = at + n, *im = re + n;
    (void)thread;
    if (first >= end)
        return;
    memset(s->gram + 2 * first * n, 0, 2 * (end - first) * n * sizeof *s->gram);
    for (size_t t = 0; t < s->n_traces; t++) {
        struct pair p = find_pair(s, t / s->pairs, t % s->pairs);
        if (!(s->weight[t] > 0.0f))
            continue;
        amplitudes(&p, n, s->scale, s->weight[t], (float)(s->format.n_samples - 1), at,
                   re, im);
        for (size_t v = first; v < end; v++)
            correlate(n, at, re, im, v, s->autocorrelation, (int)s->n_lags - 1,
                      s->gram + 2 * v * n, s->gram + (2 * v + 1) * n);
    }
}

void sparse_operator_gram(struct sparse_operator *s, float *gram)
{
    double energy = 0.0;
    for (size_t k = 0; k < 2 * s->half; k++)
        energy += pow(s->pulse[FRACTIONS / 2 * 2 * s->half + k], 2.0);
    s->gram = gram;
    pool_run(s->pool, RUNS, gram_rows, s);
    for (size_t i = 0; i < 2 * s->n * s->n; i++)
        gram[i] *= (float)energy;
}
