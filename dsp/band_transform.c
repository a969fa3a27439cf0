#include "dsp/band_transform.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/band_loops.h"
#include "dsp/fft_plan.h"
#include "dsp/fft_size.h"

#define MAX_STREAMS 32

struct band_transform {
    struct band_transform_layout layout;
    size_t n_forward, n_inverse; /* m, m': multiples of BAND_BLOCK */
    size_t first;                /* bin 0 of stream s is R first + s of L */
    float *roots;                /* [R/2][R]: cosines of the first half, sines */
    float *twiddle;              /* [R/2][2][m], real parts and imaginary parts */
    float *step, *shift;         /* [2][n_output rounded up to BAND_BLOCK] */
    float *signal;               /* [L], the input, aligned and filled up with zeros */
    float *mixed, *product;      /* [m][2], [m'][2]: of one stream at a time */
    float *spectrum;             /* [R/2][m][2] */
    float *output;               /* [R][m'][2] */
    fftwf_plan forward, inverse; /* of one stream */
};

static bool config_is_valid(const struct band_transform_config *c)
{
    return c->n_min >= 1 && c->n_min <= (1u << 26) && c->band[0] >= 0.0 &&
           c->band[1] > c->band[0] && c->band[1] <= 0.5 && c->oversampling >= 1.0 &&
           c->oversampling <= 64.0 && c->span >= 0.0 && c->span < (double)c->n_min;
}

static size_t block_round(size_t n)
{
    return (n + BAND_BLOCK - 1) / BAND_BLOCK * BAND_BLOCK;
}

/* A fast length that is a multiple of BAND_BLOCK. */
static size_t blocked_size(size_t min, double slack)
{
    return BAND_BLOCK * fft_size((min + BAND_BLOCK - 1) / BAND_BLOCK, slack);
}

/* Plans that are not measured lose more the longer they are (fitted, with what else a
 * channel costs, to all numbers of streams at pings of 2600 to 9000 samples and three
 * bands: what is chosen is 2% off the fastest, 11% at worst). */
static double transform_cost_ns(size_t n)
{
    return fft_size_cost_ns(n) * (1.0 + (double)n / 500.0);
}

/* Lengths for R streams, and what a channel then costs, in ns of a machine of 2023. */
static double layout_try(struct band_transform *bt, const struct band_transform_config *c,
                         size_t n_streams)
{
    struct band_transform_layout *l = &bt->layout;
    double low, high;
    size_t last;

    bt->n_forward = blocked_size((c->n_min + n_streams - 1) / n_streams, 1.15);
    l->n_streams = n_streams;
    l->length = n_streams * bt->n_forward;
    low = ceil(c->band[0] * (double)l->length - 0.5 - 1e-9);
    high = floor(c->band[1] * (double)l->length - 0.5 + 1e-9);
    if (low < 0.0)
        low = 0.0;
    if (high < low)
        high = low;
    bt->first = (size_t)low / n_streams;
    last = (size_t)high / n_streams;
    l->n_bins = last - bt->first + 1;
    bt->n_inverse =
        (size_t)ceil(c->oversampling * (high - low + 1.0) / (double)n_streams);
    if (bt->n_inverse < l->n_bins)
        bt->n_inverse = l->n_bins;
    bt->n_inverse = blocked_size(bt->n_inverse, 1.15);
    l->rate = (double)bt->n_inverse / (double)bt->n_forward;
    l->carrier = (floor((low + high) / 2.0) + 0.5) / (double)l->length;
    l->n_output = (size_t)floor(c->span * l->rate + 1e-6) + 1;
    return 0.5 * (double)n_streams * transform_cost_ns(bt->n_forward) +
           (double)n_streams * (transform_cost_ns(bt->n_inverse) + 60.0) +
           (double)n_streams * (0.01 * (double)l->length + 0.3 * (double)l->n_output);
}

static void layout_choose(struct band_transform *bt,
                          const struct band_transform_config *c)
{
    double best_cost = INFINITY;
    size_t best = 2;

    for (size_t r = 2; r <= MAX_STREAMS; r += 2) {
        double cost = layout_try(bt, c, r);
        if (cost < best_cost) {
            best_cost = cost;
            best = r;
        }
    }
    layout_try(bt, c, best);
}

static int scratch_create(struct band_transform *bt)
{
    size_t r = bt->layout.n_streams, m = bt->n_forward, n = bt->n_inverse;
    size_t n_table = block_round(bt->layout.n_output);

    bt->roots = fftwf_malloc(r * r / 2 * sizeof(float));
    bt->twiddle = fftwf_malloc(r * m * sizeof(float));
    bt->step = fftwf_malloc(2 * n_table * sizeof(float));
    bt->shift = fftwf_malloc(2 * n_table * sizeof(float));
    bt->signal = fftwf_malloc(r * m * sizeof(float));
    bt->mixed = fftwf_malloc(2 * m * sizeof(float));
    bt->spectrum = fftwf_malloc(r * m * sizeof(float));
    bt->product = fftwf_malloc(2 * n * sizeof(float));
    bt->output = fftwf_malloc(2 * r * n * sizeof(float));
    if (!bt->roots || !bt->twiddle || !bt->step || !bt->shift || !bt->signal ||
        !bt->mixed || !bt->spectrum || !bt->product || !bt->output)
        return -ENOMEM;
    bt->forward = fft_plan(m, bt->mixed, bt->spectrum, FFTW_FORWARD);
    bt->inverse = fft_plan(n, bt->product, bt->output, FFTW_BACKWARD);
    if (!bt->forward || !bt->inverse)
        return -ENOMEM;
    memset(bt->spectrum, 0, r * m * sizeof(float));
    memset(bt->product, 0, 2 * n * sizeof(float));
    return 0;
}

static void polar_store(float *re, float *im, double cycles)
{
    double a = 2.0 * M_PI * (cycles - floor(cycles));

    *re = (float)cos(a);
    *im = (float)sin(a);
}

static void tables_fill(struct band_transform *bt)
{
    const struct band_transform_layout *l = &bt->layout;
    size_t r = l->n_streams, m = bt->n_forward, n_table = block_round(l->n_output);
    double length = (double)l->length, back = (double)(r * bt->n_inverse);
    double offset = (double)(r * bt->first) + 0.5 - l->carrier * length;

    for (size_t s = 0; s < r / 2; s++) {
        double k = (double)s + 0.5;
        for (size_t i = 0; i < r; i++) {
            float cosine, sine;
            polar_store(&cosine, &sine, -k * (double)i / (double)r);
            bt->roots[s * r + i] = i < r / 2 ? cosine : sine;
        }
        for (size_t i = 0; i < m; i++) {
            float *t = bt->twiddle + 2 * s * m + i;
            polar_store(&t[0], &t[m], -k * (double)i / length);
        }
    }
    for (size_t i = 0; i < n_table; i++) {
        polar_store(&bt->step[i], &bt->step[n_table + i], (double)i / back);
        polar_store(&bt->shift[i], &bt->shift[n_table + i], offset * (double)i / back);
    }
}

int band_transform_create(struct band_transform **out,
                          const struct band_transform_config *c)
{
    struct band_transform *bt;
    int err;

    if (!out || !c || !config_is_valid(c))
        return -EINVAL;
    bt = calloc(1, sizeof(*bt));
    if (!bt)
        return -ENOMEM;
    layout_choose(bt, c);
    err = scratch_create(bt);
    if (err) {
        band_transform_destroy(bt);
        return err;
    }
    tables_fill(bt);
    *out = bt;
    return 0;
}

void band_transform_layout(const struct band_transform *bt,
                           struct band_transform_layout *out)
{
    *out = bt->layout;
}

double band_transform_frequency(const struct band_transform *bt, size_t stream,
                                size_t bin)
{
    size_t k = bt->layout.n_streams * (bt->first + bin) + stream;

    return ((double)k + 0.5) / (double)bt->layout.length;
}

void band_transform_forward(struct band_transform *bt, const float *x, size_t n)
{
    size_t m = bt->n_forward, r = bt->layout.n_streams;

    memcpy(bt->signal, x, n * sizeof(*x));
    memset(bt->signal + n, 0, (r * m - n) * sizeof(*x));
    band_rows_fold(bt->signal, r, m);
    for (size_t s = 0; s < r / 2; s++) {
        band_rows_mix(bt->mixed, bt->signal, r / 2, bt->roots + s * r,
                      bt->twiddle + 2 * s * m, m);
        fftwf_execute_dft(bt->forward, (fftwf_complex *)bt->mixed,
                          (fftwf_complex *)(bt->spectrum + 2 * s * m));
    }
}

/* Where a bin is: of the upper half of the streams, the conjugate of its partner. */
static const float *bin_find(const struct band_transform *bt, size_t stream, size_t bin)
{
    size_t m = bt->n_forward, r = bt->layout.n_streams, k = bt->first + bin;

    if (stream < r / 2)
        return bt->spectrum + 2 * (stream * m + k);
    return bt->spectrum + 2 * ((r - 1 - stream) * m + m - 1 - k);
}

float complex band_transform_bin(const struct band_transform *bt, size_t stream,
                                 size_t bin)
{
    const float *z = bin_find(bt, stream, bin);

    return z[0] + I * (stream < bt->layout.n_streams / 2 ? z[1] : -z[1]);
}

/* Outputs i and i + m' are made of the same values: a stream's transform repeats. */
static void streams_combine(struct band_transform *bt, float complex *y)
{
    size_t n = bt->layout.n_output, m = bt->n_inverse, n_table = block_round(n);
    float block[2 * BAND_BLOCK];

    for (size_t i = 0; i < n; i += BAND_BLOCK) {
        bool whole = i + BAND_BLOCK <= n;
        float *to = whole ? (float *)(y + i) : block;

        band_block_combine(to, bt->output + 2 * (i % m), bt->layout.n_streams, m,
                           bt->step + i, bt->shift + i, n_table);
        if (!whole)
            memcpy(y + i, block, (n - i) * sizeof(*y));
    }
}

void band_transform_inverse(struct band_transform *bt,
                            const float complex *restrict filter,
                            float complex *restrict y)
{
    size_t r = bt->layout.n_streams, n = bt->layout.n_bins, m = bt->n_inverse;

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

void band_transform_destroy(struct band_transform *bt)
{
    if (!bt)
        return;
    if (bt->forward)
        fftwf_destroy_plan(bt->forward);
    if (bt->inverse)
        fftwf_destroy_plan(bt->inverse);
    fftwf_free(bt->roots);
    fftwf_free(bt->twiddle);
    fftwf_free(bt->step);
    fftwf_free(bt->shift);
    fftwf_free(bt->signal);
    fftwf_free(bt->mixed);
    fftwf_free(bt->spectrum);
    fftwf_free(bt->product);
    fftwf_free(bt->output);
    free(bt);
}
