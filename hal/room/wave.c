#include "hal/room/wave.h"

#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <fftw3.h>

enum {
    FINE = 8,    /* points for each sample */
    MARGIN = 64, /* samples around the emission, where its ends ring */
    BLOCK = 64   /* samples on a straight axis */
};

struct wave {
    size_t n;          /* samples of the emission */
    size_t n_cells;    /* between points of the table */
    float (*cells)[4]; /* cubics in the part of a cell, 0..1 */
};

/* The spectrum's derivative'th derivative by the sample, at FINE points a sample. */
static void transform(const fftwf_complex *spectrum, size_t n, int derivative,
                      fftwf_plan plan, fftwf_complex *fine)
{
    memset(fine, 0, (FINE * n / 2 + 1) * sizeof *fine);
    for (size_t k = 0; k < n / 2; k++) {
        double omega = 2 * M_PI * (double)k / (double)n;
        double complex x = spectrum[k] / (double)n;
        for (int d = 0; d < derivative; d++)
            x *= I * omega;
        fine[k] = (float complex)x;
    }
    fftwf_execute(plan);
}

static void set_cells(struct wave *w, const float *value, const float *slope)
{
    for (size_t i = 0; i < w->n_cells; i++) {
        float *cell = w->cells[i];
        float a = value[i], b = value[i + 1];
        float da = slope[i] / FINE, db = slope[i + 1] / FINE;
        cell[0] = a;
        cell[1] = da;
        cell[2] = 3 * (b - a) - 2 * da - db;
        cell[3] = 2 * (a - b) + da + db;
    }
}

static int tabulate(struct wave *w, const float *samples, int derivative)
{
    size_t n = w->n + 2 * MARGIN + (w->n & 1), n_fine = FINE * n;
    int err = -ENOMEM;
    float *y = fftwf_alloc_real(n_fine), *values = malloc(n_fine * sizeof *values);
    fftwf_complex *spectrum = fftwf_alloc_complex(n / 2 + 1);
    fftwf_complex *fine = fftwf_alloc_complex(n_fine / 2 + 1);
    fftwf_plan forward = NULL, backward = NULL;
    if (!y || !values || !spectrum || !fine)
        goto out;
    forward = fftwf_plan_dft_r2c_1d((int)n, y, spectrum, FFTW_ESTIMATE);
    backward = fftwf_plan_dft_c2r_1d((int)n_fine, fine, y, FFTW_ESTIMATE);
    if (!forward || !backward)
        goto out;
    memset(y, 0, n * sizeof *y);
    memcpy(y + MARGIN, samples, w->n * sizeof *y);
    fftwf_execute(forward);
    transform(spectrum, n, derivative, backward, fine);
    memcpy(values, y, n_fine * sizeof *values);
    transform(spectrum, n, derivative + 1, backward, fine);
    set_cells(w, values, y);
    err = 0;
out:
    fftwf_destroy_plan(forward);
    fftwf_destroy_plan(backward);
    fftwf_free(y);
    fftwf_free(spectrum);
    fftwf_free(fine);
    free(values);
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
    w->n_cells = FINE * (n + 2 * MARGIN) - 1;
    w->cells = malloc(w->n_cells * sizeof *w->cells);
    int err = w->cells ? tabulate(w, samples, derivative) : -ENOMEM;
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
    free(w->cells);
    free(w);
}

/* The place in the table at sample t. */
static double place(const struct wave *w, const struct wave_axis *axis, double t)
{
    double u = (t - axis->start) / axis->length;
    return FINE * (MARGIN + (double)w->n * (u + axis->bend * u * (1 - u)));
}

/* Four samples at once; SSE2 and NEON have this everywhere, and it takes half the time.
 */
enum { LANES = 4 };
typedef float lanes __attribute__((vector_size(16), aligned(4), may_alias));
typedef int places __attribute__((vector_size(16)));

/* y[LANES] += the cubics of four cells at their parts. */
static inline void add_lanes(const float (*restrict cells)[4], lanes x, float amplitude,
                             float *restrict y)
{
    places k = __builtin_convertvector(x, places);
    lanes f = x - __builtin_convertvector(k, lanes);
    lanes a = *(const lanes *)cells[k[0]], b = *(const lanes *)cells[k[1]];
    lanes c = *(const lanes *)cells[k[2]], d = *(const lanes *)cells[k[3]];
    lanes ab01 = __builtin_shufflevector(a, b, 0, 4, 1, 5);
    lanes ab23 = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    lanes cd01 = __builtin_shufflevector(c, d, 0, 4, 1, 5);
    lanes cd23 = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    lanes c0 = __builtin_shufflevector(ab01, cd01, 0, 1, 4, 5);
    lanes c1 = __builtin_shufflevector(ab01, cd01, 2, 3, 6, 7);
    lanes c2 = __builtin_shufflevector(ab23, cd23, 0, 1, 4, 5);
    lanes c3 = __builtin_shufflevector(ab23, cd23, 2, 3, 6, 7);
    *(lanes *)y += amplitude * (c0 + f * (c1 + f * (c2 + f * c3)));
}

/* From a place on, a step for each sample.  The place's whole part is kept apart, so that
 * a float is enough for the rest. */
static void add_block(const struct wave *w, double at, double step, float amplitude,
                      float *restrict y, size_t n)
{
    size_t whole = (size_t)at, i = 0;
    float part = (float)(at - (double)whole), stride = (float)step;
    const lanes ramp = {0, stride, 2 * stride, 3 * stride};
    const float(*cells)[4] = (const float(*)[4])w->cells + whole;
    for (; i + LANES <= n; i += LANES)
        add_lanes(cells, part + stride * (float)i + ramp, amplitude, y + i);
    for (; i < n; i++) {
        float x = part + stride * (float)i;
        const float *c = cells[(int)x];
        float f = x - (float)(int)x;
        y[i] += amplitude * (c[0] + f * (c[1] + f * (c[2] + f * c[3])));
    }
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
    double limit = (double)w->n_cells - 1;
    while (i < end) {
        size_t m = end - i < BLOCK ? end - i : BLOCK;
        double a = place(w, axis, (double)i), b = place(w, axis, (double)(i + m));
        if (a >= 0 && b > a && b < limit)
            add_block(w, a, (b - a) / (double)m, amplitude, y + i, m);
        i += m;
    }
}
