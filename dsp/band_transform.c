#include "dsp/band_transform.h"

#include <errno.h>
#include <fftw3.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/band_loops.h"
#include "dsp/band_plan.h"
#include "dsp/fft_plan.h"

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
