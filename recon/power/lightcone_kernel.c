/* recon/power/lightcone_kernel.c -- the kernel delta(x^2 + y^2 + u - v) of the light-cone
 * transform on its lattice, and its spectrum. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/power/lightcone_plan.h"

#define MAX_SAMPLES 32 /* of a voxel's face, an axis */

/* What a cell of squared range hands to the later ones: moved on by the squared lateral
 * distance, which is `cells` wide, it covers parts of two. */
static void add_lag(float *column, size_t n, double cells, double weight)
{
    double below = floor(cells);
    if (!(below < (double)n))
        return;
    size_t at = (size_t)below;
    double part = cells - below;
    column[at] += (float)(weight * (1.0 - part));
    if (at + 1 < n)
        column[at + 1] += (float)(weight * part);
}

/* Samples of a voxel's face along one axis: no farther apart than a cell. */
static size_t face_samples(const struct lightcone *l, size_t distance, double pitch_m)
{
    double cells = 2.0 * ((double)distance + 0.5) * pitch_m * pitch_m / l->cell_m2;
    return (size_t)fmin(ceil(cells) + 1.0, MAX_SAMPLES);
}

/* The kernel at a distance of (dx, dy) voxels, over lags; an axis with one measurement
 * has no width.  Returns the sum of squares. */
static double kernel_column(const struct lightcone *l, size_t dx, size_t dy,
                            float *column)
{
    const struct lightcone_config *c = &l->cfg;
    size_t nx = c->nx > 1 ? face_samples(l, dx, c->pitch_x_m) : 1;
    size_t ny = c->ny > 1 ? face_samples(l, dy, c->pitch_y_m) : 1;
    double weight = c->pitch_x_m * c->pitch_y_m / (double)(nx * ny), sum = 0.0;
    memset(column, 0, l->period * sizeof *column);
    for (size_t j = 0; j < ny; j++) {
        double y = (double)dy + ((double)j + 0.5) / (double)ny - 0.5;
        for (size_t i = 0; i < nx; i++) {
            double x = (double)dx + ((double)i + 0.5) / (double)nx - 0.5;
            double m2 = pow(x * c->pitch_x_m, 2.0) + pow(y * c->pitch_y_m, 2.0);
            add_lag(column, l->n_squared, m2 / l->cell_m2, weight);
        }
    }
    for (size_t v = 0; v < l->n_squared; v++)
        sum += (double)column[v] * (double)column[v];
    return sum;
}

struct kernel_plan {
    struct lightcone *l;
    float *cosine_x, *cosine_y; /* [half][n lines], with the weight of a line and its
                                 * mirror image */
    double *power;              /* [ny] sum of squares over a row, both sides */
    float regulariser;
};

static void kernel_row(void *ctx, size_t dy, size_t thread)
{
    struct kernel_plan *k = ctx;
    struct lightcone *l = k->l;
    struct lightcone_scratch *s = &l->scratch[thread];
    double sum = 0.0;
    for (size_t dx = 0; dx < l->cfg.nx; dx++) {
        double times = (dx ? 2.0 : 1.0) * (dy ? 2.0 : 1.0);
        sum += times * kernel_column(l, dx, dy, s->columns);
        lightcone_transform(l, s, 0, dy, dx);
    }
    k->power[dy] = sum;
}

/* y [2 vectors] = sum over lines of cosine * x [n][stride]. */
VECTOR_INLINE void cosine_sum(const float *x, size_t n, size_t stride,
                              const float *cosine, float *y)
{
    float sum[2 * VECTOR_LANES] = {0};
    for (size_t b = 0; b < n; b++)
        for (size_t v = 0; v < 2 * VECTOR_LANES; v++)
            sum[v] += cosine[b] * x[b * stride + v];
    memcpy(y, sum, sizeof sum);
}

/* The kernel is even in x and y: its transform is a sum of cosines. */
VECTOR_CLONES
static void kernel_block(void *ctx, size_t block, size_t thread)
{
    const struct kernel_plan *k = ctx;
    struct lightcone *l = k->l;
    size_t nx = l->cfg.nx, ny = l->cfg.ny;
    float *plane = l->scratch[thread].plane; /* [half_x][ny] here */
    for (size_t iy = 0; iy < ny; iy++)
        for (size_t kx = 0; kx < l->half_x; kx++)
            cosine_sum(lightcone_point(l, block, iy, 0), nx, LANE_FFT_POINT,
                       k->cosine_x + kx * nx, plane + (kx * ny + iy) * LANE_FFT_POINT);
    for (size_t kx = 0; kx < l->half_x; kx++) {
        for (size_t ky = 0; ky < l->half_y; ky++) {
            size_t at = (block * l->half_x + kx) * l->half_y + ky;
            float *point = l->kernel + at * LANE_FFT_POINT;
            cosine_sum(plane + kx * ny * LANE_FFT_POINT, ny, LANE_FFT_POINT,
                       k->cosine_y + ky * ny, point);
            vector16 re = LANES_AT(point), im = LANES_AT(point + VECTOR_LANES);
            LANES_AT(l->damping + at * VECTOR_LANES) =
                1.0f / (re * re + im * im + k->regulariser);
        }
    }
}

static float *cosines(size_t half, size_t lines, size_t n)
{
    float *out = malloc(half * lines * sizeof *out);
    for (size_t k = 0; out && k < half; k++)
        for (size_t b = 0; b < lines; b++)
            out[k * lines + b] =
                (float)((b ? 2.0 : 1.0) * cos(2.0 * M_PI * (double)(k * b) / (double)n));
    return out;
}

int lightcone_plan_kernel(struct lightcone *l)
{
    size_t nx = l->cfg.nx, ny = l->cfg.ny;
    struct kernel_plan k = {
        .l = l,
        .cosine_x = cosines(l->half_x, nx, l->x->n),
        .cosine_y = cosines(l->half_y, ny, l->y->n),
        .power = calloc(ny, sizeof *k.power),
    };
    int err = k.cosine_x && k.cosine_y && k.power ? 0 : -ENOMEM;
    if (!err) {
        double power = 0.0;
        pool_run(l->cfg.pool, ny, kernel_row, &k);
        for (size_t iy = 0; iy < ny; iy++)
            power += k.power[iy]; /* is the mean over frequencies (Parseval) */
        k.regulariser = (float)(power / l->cfg.snr);
        pool_run(l->cfg.pool, l->n_blocks, kernel_block, &k);
    }
    free(k.cosine_x);
    free(k.cosine_y);
    free(k.power);
    return err;
}
