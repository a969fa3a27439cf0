/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm_blur.c -- the step of a periodic blur,
 * x = F* (conj(H) B + rho R) / (|H|^2 + rho (1 + |D|^2)), as planes and columns: each is
 * transformed while it is in the cache. */
#include "recon/inverse/admm_plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

#define ROW_MULTIPLE                                                                     \
    4 /* frequencies: FFTW transforms so many columns in one register                    \
       */

static size_t bins(const struct admm *a)
{
    return a->nz * a->layer;
}

static int allocate(struct admm *a)
{
    a->row = (a->nx / 2 + ROW_MULTIPLE) / ROW_MULTIPLE * ROW_MULTIPLE;
    a->layer = a->ny * a->row;
    a->spectrum = fftwf_malloc(bins(a) * sizeof *a->spectrum);
    a->kernel = fftwf_malloc(bins(a) * sizeof *a->kernel);
    a->data = fftwf_malloc(bins(a) * sizeof *a->data);
    a->power = fftwf_malloc(bins(a) * sizeof *a->power);
    int err = a->spectrum && a->kernel && a->data && a->power ? 0 : -ENOMEM;
    for (size_t t = 0; t < pool_threads(a->cfg.pool); t++) {
        a->scratch[t].column = fftwf_malloc(a->nz * a->row * sizeof *a->data);
        if (!a->scratch[t].column)
            err = -ENOMEM;
    }
    const size_t n[3] = {a->row, a->ny, a->nz}, period[3] = {a->nx, a->ny, a->nz};
    for (int d = 0; d < 3; d++) {
        a->laplace[d] = malloc(n[d] * sizeof *a->laplace[d]);
        if (!a->laplace[d])
            return -ENOMEM;
        for (size_t k = 0; k < n[d]; k++)
            a->laplace[d][k] =
                a->parts > 1
                    ? (float)(2.0 - 2.0 * cos(2.0 * M_PI * (double)k / (double)period[d]))
                    : 0.0f;
    }
    return err;
}

/* By rule, not by measurement: here that is even faster, and always the same. */
static int plan(struct admm *a)
{
    int layer[2] = {(int)a->ny, (int)a->nx}, rows[2] = {(int)a->ny, (int)a->row};
    int nz = (int)a->nz, row = (int)a->row, stride = (int)a->layer;
    struct admm_scratch *s = a->scratch;
    /* planes of an operator are dense and lie anywhere */
    unsigned flags = FFTW_ESTIMATE | (a->linear.forward ? FFTW_UNALIGNED : 0);
    a->plane_forth = fftwf_plan_many_dft_r2c(2, layer, 1, s->plane, layer, 1, 0,
                                             a->spectrum, rows, 1, 0, flags);
    a->plane_back = fftwf_plan_many_dft_c2r(2, layer, 1, a->spectrum, rows, 1, 0, a->x,
                                            layer, 1, 0, flags);
    a->column_forth = fftwf_plan_many_dft(1, &nz, row, a->spectrum, NULL, stride, 1,
                                          s->column, NULL, row, 1, FFTW_FORWARD, flags);
    a->column_back = fftwf_plan_many_dft(1, &nz, row, s->column, NULL, row, 1,
                                         a->spectrum, NULL, stride, 1, FFTW_BACKWARD,
                                         flags);
    /* frequencies that only fill a row up stay 0 */
    memset(a->spectrum, 0, bins(a) * sizeof *a->spectrum);
    bool planned = a->plane_forth && a->plane_back && a->column_forth && a->column_back;
    return planned ? 0 : -ENOMEM;
}

int admm_blur_create(struct admm *a)
{
    a->target = a->x;
    a->divide = 1.0f;
    int err = allocate(a);
    return err ? err : plan(a);
}

void admm_blur_destroy(struct admm *a)
{
    fftwf_destroy_plan(a->plane_forth);
    fftwf_destroy_plan(a->plane_back);
    fftwf_destroy_plan(a->column_forth);
    fftwf_destroy_plan(a->column_back);
    fftwf_free(a->spectrum);
    fftwf_free(a->kernel);
    fftwf_free(a->data);
    fftwf_free(a->power);
    for (int d = 0; d < 3; d++)
        free(a->laplace[d]);
}

/* -- there and back ---------------------------------------------------------------------
 */

void admm_blur_emit(struct admm *a, size_t z, size_t thread)
{
    fftwf_execute_dft_r2c(a->plane_forth, a->scratch[thread].plane,
                          a->spectrum + z * a->layer);
}

static void back_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    (void)thread;
    fftwf_execute_dft_c2r(a->plane_back, a->spectrum + z * a->layer,
                          a->target + z * a->plane);
}

VECTOR_CLONES
static void filter(size_t n, float *restrict x, const float *restrict data,
                   const float *restrict power, const float *restrict laplace_x,
                   float laplace, float rho, float scale)
{
    for (size_t k = 0; k < n; k++) {
        float g = scale / (power[k] + rho * (1.0f + laplace + laplace_x[k]));
        x[2 * k] = g * (data[2 * k] + rho * x[2 * k]);
        x[2 * k + 1] = g * (data[2 * k + 1] + rho * x[2 * k + 1]);
    }
}

static void solve_column(void *ctx, size_t y, size_t thread)
{
    struct admm *a = ctx;
    fftwf_complex *column = a->scratch[thread].column;
    fftwf_complex *at = a->spectrum + y * a->row;
    fftwf_execute_dft(a->column_forth, at, column);
    for (size_t z = 0; z < a->nz; z++) {
        size_t bin = z * a->layer + y * a->row;
        filter(a->row, column[z * a->row], a->data[bin], a->power + bin, a->laplace[0],
               a->laplace[1][y] + a->laplace[2][z], (float)a->rho,
               a->divide / (float)(a->nx * a->ny * a->nz));
    }
    fftwf_execute_dft(a->column_back, column, at);
}

void admm_blur_update(struct admm *a)
{
    pool_run(a->cfg.pool, a->ny, solve_column, a);
    pool_run(a->cfg.pool, a->nz, back_plane, a);
}

/* The full spectrum of a volume [nz][plane] times 1 / divisor stands in out. */
static void transform(struct admm *a, const float *volume, size_t plane, float divisor,
                      fftwf_complex *out)
{
    struct admm_scratch *s = a->scratch;
    for (size_t z = 0; z < a->nz; z++) {
        for (size_t i = 0; i < a->nx * a->ny; i++)
            s->plane[i] = volume[z * plane + i] / divisor;
        admm_blur_emit(a, z, 0);
    }
    for (size_t y = 0; y < a->ny; y++) {
        fftwf_execute_dft(a->column_forth, a->spectrum + y * a->row, s->column);
        for (size_t z = 0; z < a->nz; z++)
            memcpy(out + z * a->layer + y * a->row, s->column + z * a->row,
                   a->row * sizeof *out);
    }
}

/* -- kernels ----------------------------------------------------------------------------
 */

void admm_blur_power(struct admm *a, const float *response)
{
    memset(a->data, 0, bins(a) * sizeof *a->data);
    transform(a, response, a->nx * a->ny, 1.0f, a->kernel);
    for (size_t k = 0; k < bins(a); k++)
        a->power[k] = hypotf(a->kernel[k][0], a->kernel[k][1]);
}

void admm_blur_precondition(struct admm *a)
{
    a->divide = (float)(1.0 / a->rho);
    admm_blur_update(a);
}

/* Of the middle frequency of an even length both signs are the same bin: cross terms
 * cancel there. */
static double wave(size_t k, size_t n, bool *middle)
{
    *middle = 2 * k == n;
    double turns = (double)k / (double)n;
    return 2.0 * M_PI * (2 * k > n ? turns - 1.0 : turns);
}

void admm_blur_gaussian(struct admm *a, const double c[6])
{
    for (size_t k = 0; k < bins(a); k++) {
        const size_t at[3] = {k % a->row, k % a->layer / a->row, k / a->layer};
        double w[3];
        bool middle[3];
        for (int d = 0; d < 3; d++)
            w[d] = wave(at[d], a->cfg.n[d], &middle[d]);
        double form = c[0] * w[0] * w[0] + c[3] * w[1] * w[1] + c[5] * w[2] * w[2];
        form += middle[0] || middle[1] ? 0.0 : 2.0 * c[1] * w[0] * w[1];
        form += middle[0] || middle[2] ? 0.0 : 2.0 * c[2] * w[0] * w[2];
        form += middle[1] || middle[2] ? 0.0 : 2.0 * c[4] * w[1] * w[2];
        a->kernel[k][0] = (float)exp(-0.5 * fmax(form, 0.0));
        a->kernel[k][1] = 0.0f;
        a->power[k] = a->kernel[k][0] * a->kernel[k][0];
    }
    a->gain = 1.0; /* |K| of no waves is, and rho is in units of that */
}

/* -- around the iterations --------------------------------------------------------------
 */

void admm_blur_begin(struct admm *a, const float *b)
{
    float scale = 1.0f / (float)(a->nx * a->ny * a->nz);
    transform(a, b, a->nx * a->ny, (float)a->scale, a->data);
    for (size_t k = 0; k < bins(a); k++) {
        float re = a->kernel[k][0], im = a->kernel[k][1];
        float br = a->data[k][0], bi = a->data[k][1];
        a->data[k][0] = re * br + im * bi;
        a->data[k][1] = re * bi - im * br;
    }
    for (size_t y = 0; y < a->ny; y++) {
        fftwf_complex *column = a->scratch->column;
        for (size_t z = 0; z < a->nz; z++)
            for (size_t k = 0; k < a->row; k++) {
                const float *d = a->data[z * a->layer + y * a->row + k];
                column[z * a->row + k][0] = scale * d[0];
                column[z * a->row + k][1] = scale * d[1];
            }
        fftwf_execute_dft(a->column_back, column, a->spectrum + y * a->row);
    }
    pool_run(a->cfg.pool, a->nz, back_plane, a);
}

/* By Parseval, from K' b and K x: 1/2 |K x|^2 - <x, K' b> + 1/2 |b|^2. */
double admm_blur_misfit(struct admm *a, const float *b, const float *x)
{
    double sum = 0.0, squares = 0.0;
    transform(a, x, a->nx * a->ny, 1.0f, a->spectrum);
    for (size_t k = 0; k < bins(a); k++) {
        size_t kx = k % a->row;
        double twice = kx == 0 || 2 * kx == a->nx ? 1.0 : 2.0;
        double re = a->spectrum[k][0], im = a->spectrum[k][1];
        sum += kx > a->nx / 2 ? 0.0
                              : twice * (0.5 * a->power[k] * (re * re + im * im) -
                                         re * a->data[k][0] - im * a->data[k][1]);
    }
    for (size_t i = 0; i < a->nx * a->ny * a->nz; i++)
        squares += pow((double)b[i] / a->scale, 2.0);
    memset(a->spectrum, 0, bins(a) * sizeof *a->spectrum);
    return sum / (double)(a->nx * a->ny * a->nz) + 0.5 * squares;
}
