/* SPDX-License-Identifier: MIT */
#include "dsp/band_transform.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "dsp/lane_fft.h"

#define BAND_BLOCK (2 * VECTOR_LANES) /* samples that the loops take at once */

#define LANES VECTOR_LANES
#define POINT BAND_LANES_POINT

/* Positions of all rows that are mixed while the first cache has them. */
#define TILE 16

/* Floats between streams, that they do not share a cache's lines. */
#define PAD (4 * POINT)

/* Sums that are made together, so that none waits for the last. */
#define STEP 4

struct band_lanes {
    const struct band_plan *plan;
    struct lane_fft *forward, *inverse;
    uint32_t *below, *above; /* [n_bins]: places of a stream's bins, of its partner's */
    float *rows;             /* [R][TILE][16] */
    float *spectrum;         /* [R/2][m][POINT] */
    float *output;  /* [R][m'][POINT] and PAD; imaginary parts before real ones */
    float *samples; /* [n_output, 16 more][POINT] */
};

struct band_lanes_input {
    const float *x; /* [n_channels][stride] */
    size_t stride, n, n_channels;
};

static inline size_t band_lanes_output_stride(const struct band_plan *p)
{
    return p->n_inverse * POINT + PAD;
}

/* 16 signals from rows of samples to lanes, and back: blocks of 4 x 4, which every
 * machine's registers hold.  For VECTOR_CLONES functions. */
typedef float lane_four __attribute__((vector_size(16), aligned(4), may_alias));

/* to[c][r] = from[r][c] for r, c < 4. */
VECTOR_INLINE void lane_transpose_four(const float *const from[4], float *to,
                                       size_t stride)
{
    lane_four a = *(const lane_four *)from[0], b = *(const lane_four *)from[1];
    lane_four c = *(const lane_four *)from[2], d = *(const lane_four *)from[3];
    lane_four e = __builtin_shufflevector(a, b, 0, 4, 1, 5);
    lane_four f = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    lane_four g = __builtin_shufflevector(c, d, 0, 4, 1, 5);
    lane_four h = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    *(lane_four *)to = __builtin_shufflevector(e, g, 0, 1, 4, 5);
    *(lane_four *)(to + stride) = __builtin_shufflevector(e, g, 2, 3, 6, 7);
    *(lane_four *)(to + 2 * stride) = __builtin_shufflevector(f, h, 0, 1, 4, 5);
    *(lane_four *)(to + 3 * stride) = __builtin_shufflevector(f, h, 2, 3, 6, 7);
}

/* to[c][r] = from[r][c] for r, c < 16, rows apart by their strides. */
VECTOR_INLINE void lane_transpose(const float *restrict from, size_t from_stride,
                                  float *restrict to, size_t to_stride)
{
    for (size_t r = 0; r < VECTOR_LANES; r += 4) {
        const float *row = from + r * from_stride;
        for (size_t c = 0; c < VECTOR_LANES; c += 4) {
            const float *rows[4] = {row + c, row + from_stride + c,
                                    row + 2 * from_stride + c, row + 3 * from_stride + c};
            lane_transpose_four(rows, to + c * to_stride + r, to_stride);
        }
    }
}

#define MAX_STREAMS 32
#define MAX_POINTS  384  /* of 16 channels in a first cache of 48 kB */
#define MAX_EXCESS  1.15 /* of the baseband's rate over what is asked for */

static bool config_is_valid(const struct band_transform_config *c)
{
    return c->n_min >= 1 && c->n_min <= (1u << 26) && c->band[0] >= 0.0 &&
           c->band[1] > c->band[0] && c->band[1] <= 0.5 && c->oversampling >= 1.0 &&
           c->oversampling <= 64.0 && c->span >= 0.0 && c->span < (double)c->n_min &&
           c->beyond >= 0.0 && c->beyond < (double)(1u << 26);
}

/* The next length that the loops take and lane_fft transforms. */
static size_t stream_size(size_t min)
{
    size_t n = (min + BAND_BLOCK - 1) / BAND_BLOCK * BAND_BLOCK;

    while (!lane_fft_transforms(n))
        n += BAND_BLOCK;
    return n;
}

static double transform_cost_ns(size_t n)
{
    double points = (double)n;

    return (n > MAX_POINTS ? 0.09 : 0.043) * points * log2(points);
}

/* Lengths for R streams, and what each of 16 channels then costs, in ns of a machine of
 * 2023 with AVX-512: transforms, the sum before them and the sum after them. */
static double layout_try(struct band_plan *p, const struct band_transform_config *c,
                         size_t n_streams)
{
    struct band_transform_layout *l = &p->layout;
    double low, high, wanted, streams = (double)n_streams, cost;

    p->n_forward = stream_size((c->n_min + n_streams - 1) / n_streams);
    l->n_streams = n_streams;
    l->length = n_streams * p->n_forward;
    low = fmax(ceil(c->band[0] * (double)l->length - 0.5 - 1e-9), 0.0);
    high = fmax(floor(c->band[1] * (double)l->length - 0.5 + 1e-9), low);
    p->first = (size_t)low / n_streams;
    l->n_bins = (size_t)high / n_streams - p->first + 1;
    wanted =
        fmax(ceil(c->oversampling * (high - low + 1.0) / streams), (double)l->n_bins);
    p->n_inverse = stream_size((size_t)wanted);
    l->rate = (double)p->n_inverse / (double)p->n_forward;
    l->carrier = (floor((low + high) / 2.0) + 0.5) / (double)l->length;
    l->n_output = (size_t)floor(c->span * l->rate + 1e-6) + 1;
    p->n_table = (l->n_output + p->n_inverse - 1) / p->n_inverse * p->n_inverse;
    cost = 0.5 * streams * transform_cost_ns(p->n_forward) +
           streams * transform_cost_ns(p->n_inverse) +
           (0.0072 * streams + 0.1) * (double)l->length +
           (0.058 * streams + 0.1) * (double)l->n_output;
    return (double)p->n_inverse > MAX_EXCESS * wanted ? 10.0 * cost : cost;
}

static void layout_choose(struct band_plan *p, const struct band_transform_config *c)
{
    double best_cost = INFINITY;
    size_t best = 2;

    for (size_t r = 2; r <= MAX_STREAMS; r += 2) {
        double cost = layout_try(p, c, r);
        if (cost < best_cost) {
            best_cost = cost;
            best = r;
        }
    }
    layout_try(p, c, best);
    if (c->beyond > 0.0) {
        p->layout.n_output =
            (size_t)floor((c->span + c->beyond) * p->layout.rate + 1e-6) + 1;
        p->n_table = (p->layout.n_output + p->n_inverse - 1) / p->n_inverse *
                     p->n_inverse;
    }
}

int band_layout_choose(struct band_transform_layout *out,
                       const struct band_transform_config *c)
{
    struct band_plan p = {.layout = {0}};

    if (!config_is_valid(c))
        return -EINVAL;
    layout_choose(&p, c);
    *out = p.layout;
    return 0;
}

static int tables_create(struct band_plan *p)
{
    size_t r = p->layout.n_streams;

    p->roots = fftwf_malloc(r * r / 2 * sizeof(float));
    p->twiddle = fftwf_malloc(r * p->n_forward * sizeof(float));
    p->step = fftwf_malloc(2 * p->n_table * sizeof(float));
    p->shift = fftwf_malloc(2 * p->n_table * sizeof(float));
    return p->roots && p->twiddle && p->step && p->shift ? 0 : -ENOMEM;
}

static void polar_store(float *re, float *im, double cycles)
{
    double a = 2.0 * M_PI * (cycles - floor(cycles));

    *re = (float)cos(a);
    *im = (float)sin(a);
}

static void tables_fill(struct band_plan *p)
{
    const struct band_transform_layout *l = &p->layout;
    size_t r = l->n_streams, m = p->n_forward, n_table = p->n_table;
    double length = (double)l->length, back = (double)(r * p->n_inverse);
    double offset = (double)(r * p->first) + 0.5 - l->carrier * length;

    for (size_t s = 0; s < r / 2; s++) {
        double k = (double)s + 0.5;
        for (size_t i = 0; i < r; i++) {
            float cosine, sine;
            polar_store(&cosine, &sine, -k * (double)i / (double)r);
            p->roots[s * r + i] = i < r / 2 ? cosine : sine;
        }
        for (size_t i = 0; i < m; i++) {
            float *t = p->twiddle + 2 * s * m + i;
            polar_store(&t[0], &t[m], -k * (double)i / length);
        }
    }
    for (size_t i = 0; i < n_table; i++) {
        polar_store(&p->step[i], &p->step[n_table + i], (double)i / back);
        polar_store(&p->shift[i], &p->shift[n_table + i], offset * (double)i / back);
    }
}

int band_plan_init(struct band_plan *p, const struct band_transform_config *c)
{
    int err;

    if (!c || !config_is_valid(c))
        return -EINVAL;
    memset(p, 0, sizeof(*p));
    layout_choose(p, c);
    err = tables_create(p);
    if (err)
        band_plan_clear(p);
    else
        tables_fill(p);
    return err;
}

void band_plan_clear(struct band_plan *p)
{
    fftwf_free(p->roots);
    fftwf_free(p->twiddle);
    fftwf_free(p->step);
    fftwf_free(p->shift);
    p->roots = p->twiddle = p->step = p->shift = NULL; /* it may be cleared again */
}

/* The loops that band_transform spends its time in, as vector code.
 * Complex values are interleaved as re, im in spectra and planar (all real parts, then
 * all imaginary ones) in tables, so that they load as they lie. */

/* signal [n_rows][m], n_rows even: rows j and n_rows - j become their difference and
 * their sum, for all streams at once: a row's cosine is the other's turned over, its sine
 * the same. */
VECTOR_CLONES
static void band_rows_fold(float *signal, size_t n_rows, size_t m)
{
    for (size_t j = 1; j < n_rows / 2; j++) {
        float *restrict a = signal + j * m, *restrict b = signal + (n_rows - j) * m;
        for (size_t i = 0; i < m; i++) {
            float difference = a[i] - b[i];
            b[i] += a[i];
            a[i] = difference;
        }
    }
}

/* One stream before its transform: the cosines' sum over the first half of the folded
 * rows, the sines' over the second, turned by the twiddle.  out [m][2], signal
 * [2 half][m], root [2 half], twiddle [2][m]; m a multiple of BAND_BLOCK.
 *
 * The sums of a whole block at once, here and below, so that none waits for the last. */
VECTOR_CLONES
static void band_rows_mix(float *restrict out, const float *restrict signal, size_t half,
                          const float *restrict root, const float *restrict twiddle,
                          size_t m)
{
    for (size_t i = 0; i < m; i += BAND_BLOCK) {
        const float *tr = twiddle + i, *ti = twiddle + m + i;
        float *y = out + 2 * i;
        float re[BAND_BLOCK] = {0}, im[BAND_BLOCK] = {0};

        for (size_t r = 0; r < half; r++) {
            const float *a = signal + r * m + i, *b = signal + (half + r) * m + i;
            for (size_t v = 0; v < BAND_BLOCK; v++) {
                re[v] += root[r] * a[v];
                im[v] += root[half + r] * b[v];
            }
        }
        for (size_t v = 0; v < BAND_BLOCK; v++) {
            y[2 * v] = re[v] * tr[v] - im[v] * ti[v];
            y[2 * v + 1] = re[v] * ti[v] + im[v] * tr[v];
        }
    }
}

/* y = x h, all [n][2]. */
VECTOR_CLONES
static void band_bins_multiply(float *restrict y, const float *restrict x,
                               const float *restrict h, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        float re = x[2 * k], im = x[2 * k + 1];
        y[2 * k] = re * h[2 * k] - im * h[2 * k + 1];
        y[2 * k + 1] = re * h[2 * k + 1] + im * h[2 * k];
    }
}

/* The same of the conjugates, from x downwards: a stream's partner. */
VECTOR_CLONES
static void band_bins_multiply_mirrored(float *restrict y, const float *restrict x,
                                        const float *restrict h, size_t n)
{
    for (size_t k = 0; k < n; k++) {
        const float *z = x - 2 * k;
        float re = z[0], im = -z[1];
        y[2 * k] = re * h[2 * k] - im * h[2 * k + 1];
        y[2 * k + 1] = re * h[2 * k + 1] + im * h[2 * k];
    }
}

/* y[i] = shift[i] * sum over s of v[s][i] step[i]^s for a block of BAND_BLOCK, by
 * Horner's rule.  y [BAND_BLOCK][2], v [n_streams][stride][2]; step and shift
 * [2][n_table], from the block's first on: step is the phase that a bin is ahead of the
 * one before it. */
VECTOR_CLONES
static void band_block_combine(float *restrict y, const float *restrict v,
                               size_t n_streams, size_t stride,
                               const float *restrict step, const float *restrict shift,
                               size_t n_table)
{
    const float *sr = step, *si = step + n_table, *hr = shift, *hi = shift + n_table;
    float re[BAND_BLOCK] = {0}, im[BAND_BLOCK] = {0};

    for (size_t s = n_streams; s-- > 0;) {
        const float *x = v + 2 * s * stride;
        for (size_t i = 0; i < BAND_BLOCK; i++) {
            float turned = re[i] * sr[i] - im[i] * si[i];
            im[i] = re[i] * si[i] + im[i] * sr[i] + x[2 * i + 1];
            re[i] = turned + x[2 * i];
        }
    }
    for (size_t i = 0; i < BAND_BLOCK; i++) {
        y[2 * i] = re[i] * hr[i] - im[i] * hi[i];
        y[2 * i + 1] = re[i] * hi[i] + im[i] * hr[i];
    }
}

struct band_transform {
    struct band_plan plan;
    float *signal;               /* [L], the input, aligned and filled up with zeros */
    float *mixed, *product;      /* [m][2], [m'][2]: of one stream at a time */
    float *spectrum;             /* [R/2][m][2] */
    float *output;               /* [R][m'][2] */
    fftwf_plan forward, inverse; /* of one stream */
};

static int scratch_create(struct band_transform *bt)
{
    size_t r = bt->plan.layout.n_streams, m = bt->plan.n_forward, n = bt->plan.n_inverse;

    bt->signal = fftwf_malloc(r * m * sizeof(float));
    bt->mixed = fftwf_malloc(2 * m * sizeof(float));
    bt->spectrum = fftwf_malloc(r * m * sizeof(float));
    bt->product = fftwf_malloc(2 * n * sizeof(float));
    bt->output = fftwf_malloc(2 * r * n * sizeof(float));
    if (!bt->signal || !bt->mixed || !bt->spectrum || !bt->product || !bt->output)
        return -ENOMEM;
    bt->forward = fft_plan(m, bt->mixed, bt->spectrum, FFTW_FORWARD);
    bt->inverse = fft_plan(n, bt->product, bt->output, FFTW_BACKWARD);
    if (!bt->forward || !bt->inverse)
        return -ENOMEM;
    memset(bt->spectrum, 0, r * m * sizeof(float));
    memset(bt->product, 0, 2 * n * sizeof(float));
    return 0;
}

int band_transform_create(struct band_transform **out,
                          const struct band_transform_config *c)
{
    struct band_transform *bt;
    int err;

    if (!out)
        return -EINVAL;
    bt = calloc(1, sizeof(*bt));
    if (!bt)
        return -ENOMEM;
    err = band_plan_init(&bt->plan, c);
    if (!err)
        err = scratch_create(bt);
    if (err)
        band_transform_destroy(bt);
    else
        *out = bt;
    return err;
}

void band_transform_layout(const struct band_transform *bt,
                           struct band_transform_layout *out)
{
    *out = bt->plan.layout;
}

double band_transform_frequency(const struct band_transform *bt, size_t stream,
                                size_t bin)
{
    size_t k = bt->plan.layout.n_streams * (bt->plan.first + bin) + stream;

    return ((double)k + 0.5) / (double)bt->plan.layout.length;
}

void band_transform_forward(struct band_transform *bt, const float *x, size_t n)
{
    size_t m = bt->plan.n_forward, r = bt->plan.layout.n_streams;

    memcpy(bt->signal, x, n * sizeof(*x));
    memset(bt->signal + n, 0, (r * m - n) * sizeof(*x));
    band_rows_fold(bt->signal, r, m);
    for (size_t s = 0; s < r / 2; s++) {
        band_rows_mix(bt->mixed, bt->signal, r / 2, bt->plan.roots + s * r,
                      bt->plan.twiddle + 2 * s * m, m);
        fftwf_execute_dft(bt->forward, (fftwf_complex *)bt->mixed,
                          (fftwf_complex *)(bt->spectrum + 2 * s * m));
    }
}

/* Where a bin is: of the upper half of the streams, the conjugate of its partner. */
static const float *bin_find(const struct band_transform *bt, size_t stream, size_t bin)
{
    size_t m = bt->plan.n_forward, r = bt->plan.layout.n_streams,
           k = bt->plan.first + bin;

    if (stream < r / 2)
        return bt->spectrum + 2 * (stream * m + k);
    return bt->spectrum + 2 * ((r - 1 - stream) * m + m - 1 - k);
}

float complex band_transform_bin(const struct band_transform *bt, size_t stream,
                                 size_t bin)
{
    const float *z = bin_find(bt, stream, bin);

    return z[0] + I * (stream < bt->plan.layout.n_streams / 2 ? z[1] : -z[1]);
}

/* Outputs i and i + m' are made of the same values: a stream's transform repeats. */
static void streams_combine(struct band_transform *bt, float complex *y)
{
    size_t n = bt->plan.layout.n_output, m = bt->plan.n_inverse,
           n_table = bt->plan.n_table;
    float block[2 * BAND_BLOCK];

    for (size_t i = 0; i < n; i += BAND_BLOCK) {
        bool whole = i + BAND_BLOCK <= n;
        float *to = whole ? (float *)(y + i) : block;

        band_block_combine(to, bt->output + 2 * (i % m), bt->plan.layout.n_streams, m,
                           bt->plan.step + i, bt->plan.shift + i, n_table);
        if (!whole)
            memcpy(y + i, block, (n - i) * sizeof(*y));
    }
}

void band_transform_inverse(struct band_transform *bt,
                            const float complex *restrict filter,
                            float complex *restrict y)
{
    size_t r = bt->plan.layout.n_streams, n = bt->plan.layout.n_bins,
           m = bt->plan.n_inverse;

    for (size_t s = 0; s < r; s++) {
        const float *h = (const float *)(filter + s * n), *z = bin_find(bt, s, 0);

        if (s < r / 2)
            band_bins_multiply(bt->product, z, h, n);
        else
            band_bins_multiply_mirrored(bt->product, z, h, n);
        fftwf_execute_dft(bt->inverse, (fftwf_complex *)bt->product,
                          (fftwf_complex *)(bt->output + 2 * s * m));
    }
    streams_combine(bt, y);
}

const struct band_plan *band_transform_plan(const struct band_transform *bt)
{
    return &bt->plan;
}

void band_transform_destroy(struct band_transform *bt)
{
    if (!bt)
        return;
    if (bt->forward)
        fftwf_destroy_plan(bt->forward);
    if (bt->inverse)
        fftwf_destroy_plan(bt->inverse);
    band_plan_clear(&bt->plan);
    fftwf_free(bt->signal);
    fftwf_free(bt->mixed);
    fftwf_free(bt->spectrum);
    fftwf_free(bt->product);
    fftwf_free(bt->output);
    free(bt);
}

/* From rows of samples to the streams of all channels. */

/* TILE samples of all channels from `first` on, zeros beyond the last sample; lanes
 * without a channel repeat the last one. */
VECTOR_INLINE void row_load(const struct band_lanes_input *in, size_t first, float *to)
{
    float block[LANES][TILE] = {{0}};
    size_t left = first < in->n ? in->n - first : 0;

    if (in->n_channels == LANES && left >= TILE) {
        lane_transpose(in->x + first, in->stride, to, LANES);
        return;
    }
    for (size_t c = 0; c < LANES && left; c++) {
        size_t channel = c < in->n_channels ? c : in->n_channels - 1;
        memcpy(block[c], in->x + channel * in->stride + first,
               (left < TILE ? left : TILE) * sizeof(float));
    }
    lane_transpose(block[0], TILE, to, LANES);
}

/* Two rows of a tile that is needed later: so many streams of memory no machine
 * foresees. */
VECTOR_INLINE void rows_fetch(const struct band_lanes_input *in, size_t m, size_t row,
                              size_t first)
{
    for (size_t r = row; r < row + 2; r++) {
        size_t at = r * m + first;
        for (size_t c = 0; at < in->n && c < in->n_channels; c++)
            __builtin_prefetch(in->x + c * in->stride + at);
    }
}

VECTOR_INLINE void tile_load(float *rows, const struct band_lanes_input *in, size_t m,
                             size_t r, size_t first)
{
    for (size_t row = 0; row < r; row++)
        row_load(in, row * m + first, rows + row * TILE * LANES);
    for (size_t row = 1; row < r / 2; row++) {
        float *restrict a = rows + row * TILE * LANES;
        float *restrict b = rows + (r - row) * TILE * LANES;
        for (size_t i = 0; i < TILE * LANES; i++) {
            float difference = a[i] - b[i];
            b[i] += a[i];
            a[i] = difference;
        }
    }
}

/* As band_rows_mix. */
VECTOR_INLINE void tile_mix(float *restrict out, const float *restrict rows, size_t half,
                            const float *restrict root, const float *restrict twiddle,
                            size_t m)
{
    for (size_t i = 0; i < TILE; i += STEP) {
        float re[STEP][LANES] = {{0}}, im[STEP][LANES] = {{0}};

        for (size_t r = 0; r < half; r++) {
            const float *a = rows + (r * TILE + i) * LANES, *b = a + half * TILE * LANES;
#pragma GCC unroll 4 /* all STEP: their sums become registers */
            for (size_t q = 0; q < STEP; q++) {
                for (size_t v = 0; v < LANES; v++) {
                    re[q][v] += root[r] * a[q * LANES + v];
                    im[q][v] += root[half + r] * b[q * LANES + v];
                }
            }
        }
#pragma GCC unroll 4
        for (size_t q = 0; q < STEP; q++) {
            float *y = out + (i + q) * POINT, tr = twiddle[i + q],
                  ti = twiddle[m + i + q];
            for (size_t v = 0; v < LANES; v++) {
                y[v] = re[q][v] * tr - im[q][v] * ti;
                y[LANES + v] = re[q][v] * ti + im[q][v] * tr;
            }
        }
    }
}

/* The streams before their transforms, from all channels. */
VECTOR_CLONES
static void band_lanes_mix(struct band_lanes *bl, const struct band_lanes_input *in)
{
    const struct band_plan *p = bl->plan;
    size_t m = p->n_forward, r = p->layout.n_streams;

    for (size_t i = 0; i < m; i += TILE) {
        tile_load(bl->rows, in, m, r, i);
        for (size_t s = 0; s < r / 2; s++) {
            rows_fetch(in, m, 2 * s, i + 2 * TILE);
            tile_mix(bl->spectrum + (s * m + i) * POINT, bl->rows, r / 2,
                     p->roots + s * r, p->twiddle + 2 * s * m + i, m);
        }
    }
}

/* From the streams, transformed and filtered, to rows of
 * samples. */

/* A stream's bins, conjugated by `sign` -1, times their filter, real and imaginary parts
 * swapped: a transform forward of those is the swapped transform back. */
VECTOR_INLINE void bins_multiply(float *restrict y, const float *restrict spectrum,
                                 const uint32_t *place, const float *restrict filter,
                                 size_t n, bool shared, float sign)
{
    for (size_t k = 0; k < n; k++, y += POINT) {
        const float *z = spectrum + (size_t)place[k] * POINT;
        const float *h = filter + k * (shared ? 2 : POINT);

        VECTOR_LOOP
        for (size_t v = 0; v < LANES; v++) {
            float re = z[v], im = sign * z[LANES + v];
            float hr = h[shared ? 0 : v], hi = h[shared ? 1 : LANES + v];
            y[v] = re * hi + im * hr;
            y[LANES + v] = re * hr - im * hi;
        }
    }
}

VECTOR_INLINE void stream_return(struct band_lanes *bl, size_t stream,
                                 const float *spectrum, const float *filter, bool shared)
{
    const struct band_plan *p = bl->plan;
    size_t n = p->layout.n_bins, m = p->n_inverse;
    float *y = bl->output + stream * band_lanes_output_stride(p);
    bool half = 2 * n <= m;

    filter += stream * n * (shared ? 2 : POINT);
    if (stream < p->layout.n_streams / 2)
        bins_multiply(y, spectrum, bl->below, filter, n, shared, 1.0f);
    else
        bins_multiply(y, spectrum, bl->above, filter, n, shared, -1.0f);
    memset(y + n * POINT, 0, ((half ? m / 2 : m) - n) * POINT * sizeof(float));
    if (half)
        lane_fft_forward(bl->inverse, y);
    else
        lane_fft_whole(bl->inverse, y);
}

VECTOR_INLINE void streams_return(struct band_lanes *bl, const float *filter, bool shared)
{
    size_t m = bl->plan->n_forward, r = bl->plan->layout.n_streams;

    for (size_t s = 0; s < r / 2; s++) {
        float *spectrum = bl->spectrum + s * m * POINT;

        lane_fft_whole(bl->forward, spectrum);
        stream_return(bl, s, spectrum, filter, shared);
        stream_return(bl, r - 1 - s, spectrum, filter, shared);
    }
}

/* The transforms forth, the filter and the transforms back. */
VECTOR_CLONES
static void band_lanes_transform(struct band_lanes *bl, const float *filter, bool shared)
{
    if (shared)
        streams_return(bl, filter, true);
    else
        streams_return(bl, filter, false);
}

/* STEP samples at once, as band_block_combine: v [n_streams][stride], of samples `at`,
 * shift and step as in the plan. */
VECTOR_INLINE void places_combine(const struct band_plan *p, const float *restrict v,
                                  const size_t at[STEP], float *restrict samples)
{
    const float *sr = p->step, *si = sr + p->n_table;
    const float *hr = p->shift, *hi = hr + p->n_table;
    float re[STEP][LANES] = {{0}}, im[STEP][LANES] = {{0}};

    for (size_t s = p->layout.n_streams; s-- > 0;) {
        const float *x = v + s * band_lanes_output_stride(p);
#pragma GCC unroll 4
        for (size_t q = 0; q < STEP; q++) {
            float c = sr[at[q]], d = si[at[q]];
            for (size_t l = 0; l < LANES; l++) {
                float turned = x[q * POINT + LANES + l] + re[q][l] * c - im[q][l] * d;
                im[q][l] = x[q * POINT + l] + re[q][l] * d + im[q][l] * c;
                re[q][l] = turned;
            }
        }
    }
#pragma GCC unroll 4
    for (size_t q = 0; q < STEP; q++) {
        float *y = samples + at[q] * POINT, c = hr[at[q]], d = hi[at[q]];
        if (at[q] >= p->layout.n_output)
            continue;
        for (size_t l = 0; l < LANES; l++) {
            y[l] = re[q][l] * c - im[q][l] * d;
            y[LANES + l] = re[q][l] * d + im[q][l] * c;
        }
    }
}

/* The samples that are wanted, and those to rows. */
VECTOR_CLONES
static void band_lanes_combine(struct band_lanes *bl)
{
    const struct band_plan *p = bl->plan;
    const uint32_t *number = bl->inverse->number;

    for (size_t place = 0; place < p->n_inverse; place += STEP) {
        for (size_t turn = 0; turn < p->n_table; turn += p->n_inverse) {
            size_t at[STEP], least = SIZE_MAX;

            for (size_t q = 0; q < STEP; q++) {
                at[q] = number[place + q] + turn;
                least = at[q] < least ? at[q] : least;
            }
            if (least < p->layout.n_output)
                places_combine(p, bl->output + place * POINT, at, bl->samples);
        }
    }
}

VECTOR_CLONES
static void band_lanes_store(const struct band_lanes *bl, float complex *restrict y,
                             size_t n_channels)
{
    size_t n = bl->plan->layout.n_output;

    for (size_t i = 0; i < n; i += LANES / 2) {
        size_t floats = 2 * (n - i < LANES / 2 ? n - i : LANES / 2);
        float block[LANES][LANES];

        if (n_channels == LANES && floats == LANES) {
            lane_transpose(bl->samples + i * POINT, LANES, (float *)(y + i), 2 * n);
            continue;
        }
        lane_transpose(bl->samples + i * POINT, LANES, block[0], LANES);
        for (size_t c = 0; c < n_channels; c++)
            memcpy(y + c * n + i, block[c], floats * sizeof(float));
    }
}

static float *floats_alloc(size_t n)
{
    size_t line = VECTOR_LANES * sizeof(float);

    return aligned_alloc(line, (n * sizeof(float) + line - 1) / line * line);
}

static int places_create(struct band_lanes *bl)
{
    const struct band_plan *p = bl->plan;
    size_t m = p->n_forward, n = p->layout.n_bins;

    bl->below = malloc(n * sizeof(*bl->below));
    bl->above = malloc(n * sizeof(*bl->above));
    if (!bl->below || !bl->above)
        return -ENOMEM;
    for (size_t place = 0; place < m; place++) {
        size_t k = bl->forward->number[place];

        if (k >= p->first && k - p->first < n)
            bl->below[k - p->first] = (uint32_t)place;
        k = m - 1 - k;
        if (k >= p->first && k - p->first < n)
            bl->above[k - p->first] = (uint32_t)place;
    }
    return 0;
}

int band_lanes_create(struct band_lanes **out, const struct band_plan *plan)
{
    struct band_lanes *bl = calloc(1, sizeof(*bl));
    size_t r = plan->layout.n_streams, n_samples = plan->layout.n_output + LANES;
    int err;

    if (!bl)
        return -ENOMEM;
    bl->plan = plan;
    bl->rows = floats_alloc(r * TILE * LANES);
    bl->spectrum = floats_alloc(r / 2 * plan->n_forward * POINT);
    bl->output = floats_alloc(r * band_lanes_output_stride(plan));
    bl->samples = floats_alloc(n_samples * POINT);
    err = bl->rows && bl->spectrum && bl->output && bl->samples ? 0 : -ENOMEM;
    if (!err)
        memset(bl->samples, 0, n_samples * POINT * sizeof(float));
    if (!err)
        err = lane_fft_create(&bl->forward, plan->n_forward);
    if (!err)
        err = lane_fft_create(&bl->inverse, plan->n_inverse);
    if (!err)
        err = places_create(bl);
    if (err)
        band_lanes_destroy(bl);
    else
        *out = bl;
    return err;
}

void band_lanes_destroy(struct band_lanes *bl)
{
    if (!bl)
        return;
    lane_fft_destroy(bl->forward);
    lane_fft_destroy(bl->inverse);
    free(bl->below);
    free(bl->above);
    free(bl->rows);
    free(bl->spectrum);
    free(bl->output);
    free(bl->samples);
    free(bl);
}

void band_lanes_filter(const struct band_plan *plan, float *filter, size_t lane,
                       const float complex *of_lane)
{
    size_t n = plan->layout.n_streams * plan->layout.n_bins;

    for (size_t i = 0; i < n; i++) {
        filter[i * POINT + lane] = crealf(of_lane[i]);
        filter[i * POINT + LANES + lane] = cimagf(of_lane[i]);
    }
}

void band_lanes_execute(struct band_lanes *bl, const float *x, size_t x_stride, size_t n,
                        const float *filter, bool shared, float complex *restrict y,
                        size_t n_channels)
{
    const struct band_lanes_input in = {x, x_stride, n, n_channels};

    band_lanes_mix(bl, &in);
    band_lanes_transform(bl, filter, shared);
    band_lanes_combine(bl);
    band_lanes_store(bl, y, n_channels);
}
