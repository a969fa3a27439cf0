#include "recon/power/lightcone.h"

#include <string.h>

#include "recon/power/lightcone_plan.h"

enum filter { FILTER_FORWARD, FILTER_ADJOINT, FILTER_WIENER };

struct pass { /* what the workers share */
    struct lightcone *l;
    enum filter filter;
    const float *in;
    float *out;
    const struct shares *to_cells, *from_cells;
};

/* -- columns ----------------------------------------------------------------------------
 */

/* numbers[16 n_blocks] of one column <-> its points of the spectrum, which lie apart. */
VECTOR_CLONES
static void store_numbers(const struct lightcone *l, const fftwf_complex *numbers,
                          float *point)
{
    size_t apart = l->cfg.nx * l->cfg.ny * LANE_FFT_POINT;
    for (size_t b = 0; b < l->n_blocks; b++) {
        const float *from = (const float *)(numbers + b * VECTOR_LANES);
        for (size_t a = 0; a < VECTOR_LANES; a++) {
            point[a] = from[2 * a];
            point[VECTOR_LANES + a] = from[2 * a + 1];
        }
        point += apart;
    }
}

VECTOR_CLONES
static void load_numbers(const struct lightcone *l, const float *point,
                         fftwf_complex *numbers)
{
    size_t apart = l->cfg.nx * l->cfg.ny * LANE_FFT_POINT;
    for (size_t b = 0; b < l->n_blocks; b++) {
        float *to = (float *)(numbers + b * VECTOR_LANES);
        for (size_t a = 0; a < VECTOR_LANES; a++) {
            to[2 * a] = point[a];
            to[2 * a + 1] = point[VECTOR_LANES + a];
        }
        point += apart;
    }
}

void lightcone_transform(struct lightcone *l, struct lightcone_scratch *s, size_t which,
                         size_t iy, size_t ix)
{
    fftwf_execute_dft_r2c(l->forth, s->columns + which * l->period, s->numbers);
    memset(s->numbers + l->period / 2 + 1, 0,
           (l->n_blocks * VECTOR_LANES - l->period / 2 - 1) * sizeof *s->numbers);
    store_numbers(l, s->numbers, lightcone_point(l, 0, iy, ix));
}

/* out[n][m] = in[m][n] of a part of two matrices. */
VECTOR_CLONES
static void transpose(const float *in, size_t in_stride, size_t n, size_t m, float *out,
                      size_t out_stride)
{
    size_t i = 0;
    for (; i + 8 <= n; i += 8) /* 8 rows of `out` at once: whole cache lines of `in` */
        for (size_t j = 0; j < m; j++)
            for (size_t q = 0; q < 8; q++)
                out[(i + q) * out_stride + j] = in[j * in_stride + i + q];
    for (; i < n; i++)
        for (size_t j = 0; j < m; j++)
            out[i * out_stride + j] = in[j * in_stride + i];
}

/* cells[n_squared][nx] of a row. */
VECTOR_CLONES
static void fade_row(const struct lightcone *l, size_t iy, float *cells)
{
    size_t nx = l->cfg.nx;
    for (size_t v = 0; v < l->n_squared; v++)
        for (size_t x = 0; x < nx; x++)
            cells[v * nx + x] *= l->fade_y[iy] * l->fade_x[x];
}

static void transform_row(void *ctx, size_t iy, size_t thread)
{
    const struct pass *p = ctx;
    struct lightcone *l = p->l;
    struct lightcone_scratch *s = &l->scratch[thread];
    size_t nx = l->cfg.nx, nt = l->cfg.nt, pad = l->period - l->n_squared;
    if (p->filter == FILTER_FORWARD) {
        shares_apply(p->to_cells, p->in + iy * nx, nx * l->cfg.ny, nx, s->cells, nx);
    } else {
        transpose(p->in + iy * nx * nt, nt, nt, nx, s->bins, nx);
        shares_apply(p->to_cells, s->bins, nx, nx, s->cells, nx);
        if (p->filter == FILTER_WIENER && l->cfg.taper > 0.0)
            fade_row(l, iy, s->cells);
    }
    for (size_t ix = 0; ix < nx; ix += LIGHTCONE_COLUMNS) {
        size_t n = nx - ix < LIGHTCONE_COLUMNS ? nx - ix : LIGHTCONE_COLUMNS;
        transpose(s->cells + ix, nx, n, l->n_squared, s->columns, l->period);
        for (size_t q = 0; q < n; q++) {
            memset(s->columns + q * l->period + l->n_squared, 0, pad * sizeof(float));
            lightcone_transform(l, s, q, iy, ix + q);
        }
    }
}

static void restore_row(void *ctx, size_t iy, size_t thread)
{
    const struct pass *p = ctx;
    struct lightcone *l = p->l;
    struct lightcone_scratch *s = &l->scratch[thread];
    size_t nx = l->cfg.nx, nt = l->cfg.nt;
    for (size_t ix = 0; ix < nx; ix += LIGHTCONE_COLUMNS) {
        size_t n = nx - ix < LIGHTCONE_COLUMNS ? nx - ix : LIGHTCONE_COLUMNS;
        for (size_t q = 0; q < n; q++) {
            load_numbers(l, lightcone_point(l, 0, iy, ix + q), s->numbers);
            fftwf_execute_dft_c2r(l->back, s->numbers, s->columns + q * l->period);
        }
        transpose(s->columns, l->period, l->n_squared, n, s->cells + ix, nx);
    }
    if (p->filter == FILTER_FORWARD) {
        shares_apply(p->from_cells, s->cells, nx, nx, s->bins, nx);
        transpose(s->bins, nx, nx, nt, p->out + iy * nx * nt, nt);
    } else {
        shares_apply(p->from_cells, s->cells, nx, nx, p->out + iy * nx, nx * l->cfg.ny);
    }
}

/* -- one block of frequencies -----------------------------------------------------------
 */

/* line[y->n] *= the filter at lateral frequency kx. */
VECTOR_INLINE void filter_line(const struct lightcone *l, enum filter filter,
                               const float *kernel, const float *damping, float *line)
{
    for (size_t at = 0; at < l->y->n; at++) {
        size_t ky = l->y->number[at];
        ky = ky < l->half_y ? ky : l->y->n - ky;
        const float *k = kernel + ky * LANE_FFT_POINT;
        float *x = line + at * LANE_FFT_POINT;
        vector16 kr = LANES_AT(k), ki = LANES_AT(k + VECTOR_LANES);
        vector16 re = LANES_AT(x), im = LANES_AT(x + VECTOR_LANES);
        if (filter == FILTER_WIENER) {
            vector16 g = LANES_AT(damping + ky * VECTOR_LANES);
            kr *= g;
            ki *= g;
        }
        if (filter != FILTER_FORWARD)
            ki = -ki;
        LANES_AT(x) = re * kr - im * ki;
        LANES_AT(x + VECTOR_LANES) = re * ki + im * kr;
    }
}

/* n points, zeros up to the half of a transform. */
VECTOR_INLINE void load_line(float *to, const float *from, size_t stride, size_t n,
                             size_t half)
{
    for (size_t i = 0; i < n; i++) {
        LANES_AT(to + i * LANE_FFT_POINT) = LANES_AT(from + i * stride);
        LANES_AT(to + i * LANE_FFT_POINT + VECTOR_LANES) =
            LANES_AT(from + i * stride + VECTOR_LANES);
    }
    memset(to + n * LANE_FFT_POINT, 0, (half - n) * LANE_FFT_POINT * sizeof *to);
}

VECTOR_INLINE void filter_columns(const struct pass *p, size_t block, float *plane,
                                  float *line)
{
    const struct lightcone *l = p->l;
    size_t ny = l->cfg.ny, stride = l->stride * LANE_FFT_POINT;
    for (size_t at = 0; at < l->x->n; at++) {
        size_t kx = l->x->number[at];
        kx = kx < l->half_x ? kx : l->x->n - kx;
        size_t row = (block * l->half_x + kx) * l->half_y;
        float *column = plane + at * LANE_FFT_POINT;
        load_line(line, column, stride, ny, l->y->n / 2);
        lane_fft_forward(l->y, line);
        filter_line(l, p->filter, l->kernel + row * LANE_FFT_POINT,
                    l->damping + row * VECTOR_LANES, line);
        lane_fft_backward(l->y, line);
        for (size_t iy = 0; iy < ny; iy++) {
            const float *from = line + iy * LANE_FFT_POINT;
            LANES_AT(column + iy * stride) = LANES_AT(from);
            LANES_AT(column + iy * stride + VECTOR_LANES) = LANES_AT(from + VECTOR_LANES);
        }
    }
}

VECTOR_CLONES
static void filter_block(void *ctx, size_t block, size_t thread)
{
    const struct pass *p = ctx;
    struct lightcone *l = p->l;
    struct lightcone_scratch *s = &l->scratch[thread];
    size_t nx = l->cfg.nx;
    for (size_t iy = 0; iy < l->cfg.ny; iy++) {
        float *row = s->plane + iy * l->stride * LANE_FFT_POINT;
        load_line(row, lightcone_point(l, block, iy, 0), LANE_FFT_POINT, nx, l->x->n / 2);
        lane_fft_forward(l->x, row);
    }
    filter_columns(p, block, s->plane, s->line);
    for (size_t iy = 0; iy < l->cfg.ny; iy++) {
        float *row = s->plane + iy * l->stride * LANE_FFT_POINT;
        lane_fft_backward(l->x, row);
        memcpy(lightcone_point(l, block, iy, 0), row, nx * LANE_FFT_POINT * sizeof *row);
    }
}

static void run(struct pass *p)
{
    const struct lightcone_config *c = &p->l->cfg;
    pool_run(c->pool, c->ny, transform_row, p);
    pool_run(c->pool, p->l->n_blocks, filter_block, p);
    pool_run(c->pool, c->ny, restore_row, p);
}

void lightcone_forward(struct lightcone *l, const float *rho, float *tau)
{
    struct pass p = {l, FILTER_FORWARD, rho, tau, l->volume_to_cells, l->cells_to_bins};
    run(&p);
}

void lightcone_adjoint(struct lightcone *l, const float *tau, float *rho)
{
    struct pass p = {l, FILTER_ADJOINT, tau, rho, l->bins_to_cells, l->cells_to_volume};
    run(&p);
}

void lightcone_inverse(struct lightcone *l, const float *tau, float *rho)
{
    struct pass p = {l,   FILTER_WIENER,       tau,
                     rho, l->inverse_to_cells, l->inverse_to_volume};
    run(&p);
}
