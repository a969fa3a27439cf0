/* SPDX-License-Identifier: MIT */
#include "hal/room/wave.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <fftw3.h>

enum {
    FINE = 4,    /* points for each sample */
    TERMS = 8,   /* of the series around each */
    MARGIN = 64, /* samples around the emission, where its ends ring */
    BLOCK = 64,  /* samples on a straight axis */
    LANES = 16   /* samples at once: so many more may be read */
};

struct wave {
    size_t n;      /* samples of the emission */
    size_t n_row;  /* of a row of the table */
    float *series; /* [FINE][TERMS][n_row]: of points FINE apart, term by term */
};

/* The spectrum's derivative'th derivative by the sample, and of that a term of the series
 * by the point, at FINE points a sample. */
static void transform(const fftwf_complex *spectrum, size_t n, int derivative, int term,
                      fftwf_plan plan, fftwf_complex *fine)
{
    memset(fine, 0, (FINE * n / 2 + 1) * sizeof *fine);
    for (size_t k = 0; k < n / 2; k++) {
        double omega = 2 * M_PI * (double)k / (double)n;
        double complex x = spectrum[k] / (double)n;
        for (int d = 0; d < derivative; d++)
            x *= I * omega;
        for (int d = 1; d <= term; d++)
            x *= I * omega / (FINE * d);
        fine[k] = (float complex)x;
    }
    fftwf_execute(plan);
}

static int tabulate(struct wave *w, const float *samples, int derivative)
{
    size_t n = w->n + 2 * MARGIN + (w->n & 1), n_fine = FINE * n;
    int err = -ENOMEM;
    float *y = fftwf_alloc_real(n_fine);
    fftwf_complex *spectrum = fftwf_alloc_complex(n / 2 + 1);
    fftwf_complex *fine = fftwf_alloc_complex(n_fine / 2 + 1);
    fftwf_plan forward = NULL, backward = NULL;
    if (!y || !spectrum || !fine)
        goto out;
    forward = fftwf_plan_dft_r2c_1d((int)n, y, spectrum, FFTW_ESTIMATE);
    backward = fftwf_plan_dft_c2r_1d((int)n_fine, fine, y, FFTW_ESTIMATE);
    if (!forward || !backward)
        goto out;
    memset(y, 0, n * sizeof *y);
    memcpy(y + MARGIN, samples, w->n * sizeof *y);
    fftwf_execute(forward);
    for (size_t term = 0; term < TERMS; term++) {
        transform(spectrum, n, derivative, (int)term, backward, fine);
        for (size_t i = 0; i < n_fine; i++)
            w->series[(i % FINE * TERMS + term) * w->n_row + i / FINE] = y[i];
    }
    err = 0;
out:
    fftwf_destroy_plan(forward);
    fftwf_destroy_plan(backward);
    fftwf_free(y);
    fftwf_free(spectrum);
    fftwf_free(fine);
    return err;
}

int wave_create(struct wave **out, const float *samples, size_t n, int derivative)
{
    *out = NULL;
    if (!n || derivative < 0)
        return -EINVAL;
    struct wave *w = calloc(1, sizeof *w);
    if (!w)
        return -ENOMEM;
    w->n = n;
    w->n_row = n + (n & 1) + 2 * MARGIN + LANES;
    w->series = calloc(FINE * TERMS * w->n_row, sizeof *w->series);
    int err = w->series ? tabulate(w, samples, derivative) : -ENOMEM;
    if (err) {
        wave_destroy(w);
        return err;
    }
    *out = w;
    return 0;
}

void wave_destroy(struct wave *w)
{
    if (!w)
        return;
    free(w->series);
    free(w);
}

/* The place in the table at sample t, in points. */
static double place(const struct wave *w, const struct wave_axis *axis, double t)
{
    double u = (t - axis->start) / axis->length;
    return FINE * (MARGIN + (double)w->n * (u + axis->bend * u * (1 - u)));
}

/* y[n], and up to LANES beyond, of one point's row: its series at part, part + stride...
 */
static void sum_series(const float *restrict row, size_t n_row, float part, float stride,
                       float *restrict y, size_t n)
{
    for (size_t i = 0; i < n; i += LANES) {
        float sum[LANES], x[LANES];
        for (size_t k = 0; k < LANES; k++) {
            x[k] = part + stride * (float)(int)(i + k);
            sum[k] = row[(TERMS - 1) * n_row + i + k];
        }
        for (size_t term = TERMS - 1; term-- > 0;)
            for (size_t k = 0; k < LANES; k++)
                sum[k] = row[term * n_row + i + k] + x[k] * sum[k];
        memcpy(y + i, sum, sizeof sum);
    }
}

/* y[n] from a place on, a step for each sample.  As long as an axis is not far from the
 * recording's pace, samples in a row are near points FINE apart: on while the part that
 * is left is within 1. */
static void read_block(const struct wave *w, double at, double step, float *restrict y,
                       size_t n)
{
    double stride = step - FINE, each = stride == 0 ? 0 : 1 / stride;
    for (size_t i = 0, run; i < n; i += run) {
        double here = at + step * (double)i;
        size_t point = (size_t)here + (stride > 0);
        double part = here - (double)point;
        double length = each == 0 ? (double)n : ((stride > 0 ? 1 : -1) - part) * each;
        run = length < (double)(n - i) ? (size_t)length + 1 : n - i;
        run = run < n - i ? run : n - i;
        sum_series(w->series + point % FINE * TERMS * w->n_row + point / FINE, w->n_row,
                   (float)part, (float)stride, y + i, run);
    }
}

static void add_scaled(const float *restrict x, float amplitude, float *restrict y,
                       size_t n)
{
    for (size_t i = 0; i < n; i++)
        y[i] += amplitude * x[i];
}

void wave_add(const struct wave *w, const struct wave_axis *axis, float amplitude,
              float *restrict y, size_t n)
{
    double ring = MARGIN - 4;
    double first = ceil(axis->start - ring),
           last = floor(axis->start + axis->length + ring);
    if (!(last >= 0) || !(first < (double)n))
        return;
    size_t i = first > 0 ? (size_t)first : 0;
    size_t end = last + 1 < (double)n ? (size_t)last + 1 : n;
    double limit = FINE * (double)(w->n + 2 * MARGIN) - 1, a, b;
    b = place(w, axis, (double)i);
    while (i < end) {
        float block[BLOCK + LANES];
        size_t m = end - i < BLOCK ? end - i : BLOCK;
        a = b;
        b = place(w, axis, (double)(i + m));
        if (a >= 1 && b > a && b < limit) {
            read_block(w, a, (b - a) / (double)m, block, m);
            add_scaled(block, amplitude, y + i, m);
        }
        i += m;
    }
}
