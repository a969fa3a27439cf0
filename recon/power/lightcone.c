/* SPDX-License-Identifier: MIT */
#include "recon/power/lightcone.h"

#include <errno.h>
#include <fftw3.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "dsp/lane_fft.h"
#include "recon/power/shares.h"

#define COLUMNS 16 /* squared columns that are transformed together */

struct scratch {            /* one a thread */
    float *bins;            /* [nt][nx] */
    float *cells;           /* [n_squared][nx] */
    float *columns;         /* [COLUMNS][period] */
    fftwf_complex *numbers; /* [n_blocks * VECTOR_LANES] frequencies of a column */
    float *plane;           /* [ny][stride] points of LANE_FFT_POINT */
    float *line;            /* [y->n] points */
};

struct lightcone {
    struct lightcone_config cfg;
    size_t n_squared, period; /* cells, twice as many */
    size_t n_blocks;          /* of VECTOR_LANES frequencies of squared range */
    double first_m2, cell_m2; /* edge of cell 0, width */
    struct lane_fft *x, *y;
    size_t stride;         /* points of a row of the plane, no power of two */
    size_t half_x, half_y; /* frequencies of the kernel, which is even in x and y */

    struct shares *volume_to_cells, *cells_to_volume; /* each other's transpose, but */
    struct shares *bins_to_cells, *cells_to_bins;     /* for the inverse: these two */
    struct shares *inverse_to_cells, *inverse_to_volume;

    float *fade_x, *fade_y; /* [nx], [ny]: of the inverse's measurements */
    float *kernel;          /* [n_blocks][half_x][half_y] points */
    float *damping;  /* [n_blocks][half_x][half_y][VECTOR_LANES]: of the Wiener filter */
    float *spectrum; /* [n_blocks][ny][nx] points */
    struct scratch *scratch;
    fftwf_plan forth, back;
};

/* The point of the spectrum of column (ix, iy) in a block. */
static inline float *point_at(const struct lightcone *l, size_t block, size_t iy,
                              size_t ix)
{
    return l->spectrum + ((block * l->cfg.ny + iy) * l->cfg.nx + ix) * LANE_FFT_POINT;
}

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

/* columns[which] of the thread's scratch, zero from n_squared on, to the spectrum. */
static void transform_column(struct lightcone *l, struct scratch *s, size_t which,
                             size_t iy, size_t ix)
{
    fftwf_execute_dft_r2c(l->forth, s->columns + which * l->period, s->numbers);
    memset(s->numbers + l->period / 2 + 1, 0,
           (l->n_blocks * VECTOR_LANES - l->period / 2 - 1) * sizeof *s->numbers);
    store_numbers(l, s->numbers, point_at(l, 0, iy, ix));
}

/* -- the kernel delta(x^2 + y^2 + u - v) on its lattice, and its spectrum ---------------
 */

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
    struct scratch *s = &l->scratch[thread];
    double sum = 0.0;
    for (size_t dx = 0; dx < l->cfg.nx; dx++) {
        double times = (dx ? 2.0 : 1.0) * (dy ? 2.0 : 1.0);
        sum += times * kernel_column(l, dx, dy, s->columns);
        transform_column(l, s, 0, dy, dx);
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
            cosine_sum(point_at(l, block, iy, 0), nx, LANE_FFT_POINT,
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

/* Fills kernel and damping; the rest is planned and allocated.  0, -ENOMEM. */
static int plan_kernel(struct lightcone *l)
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

#define SIZE_SLACK 1.06 /* cells more than asked for when the transform gains by it */

/* -- resampling -------------------------------------------------------------------------
 */

static double bin_edge(double middle0, double step, double n)
{
    return fmax(middle0 + (n - 0.5) * step, 0.0);
}

static double *ranges_of_lattice(double middle0, double step, size_t n)
{
    double *edges = malloc((n + 1) * sizeof *edges);
    for (size_t i = 0; edges && i <= n; i++)
        edges[i] = bin_edge(middle0, step, (double)i);
    return edges;
}

static double *ranges_of_cells(const struct lightcone *l)
{
    double *edges = malloc((l->n_squared + 1) * sizeof *edges);
    for (size_t i = 0; edges && i <= l->n_squared; i++)
        edges[i] = sqrt(l->first_m2 + (double)i * l->cell_m2);
    return edges;
}

struct resampling { /* edges in m and in m2, and gains */
    double *bins, *cells, *planes;
    double *bins2, *cells2, *planes2;
    double *ones, *gain, *inverse_gain;
};

static double *squares(const double *edges, size_t n)
{
    double *out = malloc(n * sizeof *out);
    for (size_t i = 0; out && edges && i < n; i++)
        out[i] = edges[i] * edges[i];
    return out;
}

static void resampling_clear(struct resampling *r)
{
    free(r->bins);
    free(r->cells);
    free(r->planes);
    free(r->bins2);
    free(r->cells2);
    free(r->planes2);
    free(r->ones);
    free(r->gain);
    free(r->inverse_gain);
}

static int resampling_fill(struct resampling *r, const struct lightcone *l)
{
    const struct lightcone_config *c = &l->cfg;
    size_t longest = l->n_squared + c->nt + c->nz;
    r->bins = ranges_of_lattice(c->range_m, c->range_step_m, c->nt);
    r->planes = ranges_of_lattice(c->depth_m, c->depth_step_m, c->nz);
    r->cells = ranges_of_cells(l);
    r->bins2 = squares(r->bins, c->nt + 1);
    r->planes2 = squares(r->planes, c->nz + 1);
    r->cells2 = squares(r->cells, l->n_squared + 1);
    r->ones = malloc(longest * sizeof *r->ones);
    r->gain = malloc(c->nt * sizeof *r->gain);
    r->inverse_gain = malloc(c->nt * sizeof *r->inverse_gain);
    if (!r->bins || !r->planes || !r->cells || !r->bins2 || !r->planes2 || !r->cells2 ||
        !r->ones || !r->gain || !r->inverse_gain)
        return -ENOMEM;
    for (size_t i = 0; i < longest; i++)
        r->ones[i] = 1.0;
    for (size_t n = 0; n < c->nt; n++) {
        double range_m = c->range_m + (double)n * c->range_step_m;
        r->gain[n] = pow(2.0 * fmax(range_m, 0.5 * c->range_step_m), c->falloff);
        r->inverse_gain[n] = 1.0 / r->gain[n];
    }
    return 0;
}

static double *scaled(size_t n, double value)
{
    double *out = malloc(n * sizeof *out);
    for (size_t i = 0; out && i < n; i++)
        out[i] = value;
    return out;
}

/* Cells and bins hold what falls into them, voxels a density: a cell gets density times
 * length, and a bin is divided by its own.  The transforms' factor goes with the cells'
 * entry. */
static int plan_shares(struct lightcone *l, const struct resampling *r)
{
    const struct lightcone_config *c = &l->cfg;
    double factor = 1.0 / ((double)l->period * (double)l->x->n * (double)l->y->n);
    double *entry = scaled(l->n_squared, factor);
    double *per_cell = scaled(l->n_squared, 1.0 / (l->cell_m2 * c->range_step_m));
    double *per_plane = scaled(c->nz, 1.0 / (l->cell_m2 * c->depth_step_m));
    int err = entry && per_cell && per_plane ? 0 : -ENOMEM;
    if (!err)
        err = shares_create(&l->volume_to_cells, r->cells, l->n_squared, r->planes, c->nz,
                            entry, r->ones);
    if (!err)
        err = shares_create(&l->cells_to_bins, r->bins2, c->nt, r->cells2, l->n_squared,
                            r->inverse_gain, per_cell);
    if (!err)
        err = shares_create(&l->inverse_to_cells, r->cells, l->n_squared, r->bins, c->nt,
                            entry, r->gain);
    if (!err)
        err = shares_create(&l->inverse_to_volume, r->planes2, c->nz, r->cells2,
                            l->n_squared, per_plane, r->ones);
    if (!err)
        err = shares_transpose(&l->cells_to_volume, l->volume_to_cells);
    if (!err)
        err = shares_transpose(&l->bins_to_cells, l->cells_to_bins);
    free(entry);
    free(per_cell);
    free(per_plane);
    return err;
}

static int plan_resampling(struct lightcone *l)
{
    struct resampling r = {0};
    int err = resampling_fill(&r, l);
    if (!err)
        err = plan_shares(l, &r);
    resampling_clear(&r);
    return err;
}

/* -- create -----------------------------------------------------------------------------
 */

static void plan_squared(struct lightcone *l)
{
    const struct lightcone_config *c = &l->cfg;
    double near_m = fmin(bin_edge(c->range_m, c->range_step_m, 0.0),
                         bin_edge(c->depth_m, c->depth_step_m, 0.0));
    double far_m = fmax(bin_edge(c->range_m, c->range_step_m, (double)c->nt),
                        bin_edge(c->depth_m, c->depth_step_m, (double)c->nz));
    l->n_squared = fft_size(c->n_squared, SIZE_SLACK);
    l->period = 2 * l->n_squared;
    l->n_blocks = (l->period / 2 + 1 + VECTOR_LANES - 1) / VECTOR_LANES;
    l->first_m2 = near_m * near_m;
    l->cell_m2 = (far_m * far_m - l->first_m2) / (double)l->n_squared;
    l->half_x = l->x->n / 2 + 1;
    l->half_y = l->y->n / 2 + 1;
    l->stride = l->x->n + 1;
}

/* Hann flanks. */
static float *fades(size_t n, double taper)
{
    float *out = malloc(n * sizeof *out);
    for (size_t i = 0; out && i < n; i++) {
        double edge = fmin((double)i + 0.5, (double)n - 0.5 - (double)i);
        double part = n > 1 && taper > 0.0 ? edge / (taper * (double)n) : 1.0;
        out[i] = part < 1.0 ? (float)(0.5 - 0.5 * cos(M_PI * part)) : 1.0f;
    }
    return out;
}

static float *floats(size_t n)
{
    return fftwf_malloc(n * sizeof(float));
}

static int allocate(struct lightcone *l)
{
    const struct lightcone_config *c = &l->cfg;
    size_t halves = l->half_x * l->half_y * l->n_blocks;
    l->kernel = floats(halves * LANE_FFT_POINT);
    l->damping = floats(halves * VECTOR_LANES);
    l->spectrum = floats(l->n_blocks * c->nx * c->ny * LANE_FFT_POINT);
    l->scratch = calloc(pool_threads(c->pool), sizeof *l->scratch);
    l->fade_x = fades(c->nx, c->taper);
    l->fade_y = fades(c->ny, c->taper);
    if (!l->fade_x || !l->fade_y || !l->kernel || !l->damping || !l->spectrum ||
        !l->scratch)
        return -ENOMEM;
    for (size_t t = 0; t < pool_threads(c->pool); t++) {
        struct scratch *s = &l->scratch[t];
        size_t numbers = l->n_blocks * VECTOR_LANES;
        s->bins = floats(c->nt * c->nx);
        s->cells = floats(l->n_squared * c->nx);
        s->columns = floats(COLUMNS * l->period);
        s->numbers = fftwf_malloc(numbers * sizeof *s->numbers);
        s->plane = floats((c->ny + 1) * l->stride * LANE_FFT_POINT);
        s->line = floats(l->y->n * LANE_FFT_POINT);
        if (!s->bins || !s->cells || !s->columns || !s->numbers || !s->plane || !s->line)
            return -ENOMEM;
    }
    return 0;
}

static int plan_transforms(struct lightcone *l)
{
    struct scratch *s = l->scratch;
    int n = (int)l->period;
    l->forth =
        fftwf_plan_dft_r2c_1d(n, s->columns, s->numbers, FFTW_ESTIMATE | FFTW_UNALIGNED);
    l->back =
        fftwf_plan_dft_c2r_1d(n, s->numbers, s->columns, FFTW_ESTIMATE | FFTW_UNALIGNED);
    if (!l->forth || !l->back)
        return -ENOMEM;
    return 0;
}

static bool sensible(const struct lightcone_config *c)
{
    return c->nx && c->ny && c->nt && c->pool && c->pitch_x_m > 0.0 &&
           c->pitch_y_m > 0.0 && isfinite(c->pitch_x_m * c->pitch_y_m) &&
           c->range_m >= 0.0 && isfinite(c->range_m) && c->range_step_m > 0.0 &&
           isfinite(c->range_step_m) && c->falloff >= 0.0 && c->falloff <= 8.0 &&
           c->snr > 0.0 && isfinite(c->snr) && c->taper >= 0.0 && c->taper <= 0.5 &&
           (!c->nz || (c->depth_m >= 0.0 && isfinite(c->depth_m) &&
                       c->depth_step_m > 0.0 && isfinite(c->depth_step_m)));
}

int lightcone_create(struct lightcone **out, const struct lightcone_config *cfg)
{
    if (!sensible(cfg))
        return -EINVAL;
    struct lightcone *l = calloc(1, sizeof *l);
    if (!l)
        return -ENOMEM;
    l->cfg = *cfg;
    if (!cfg->nz) {
        l->cfg.nz = cfg->nt;
        l->cfg.depth_m = cfg->range_m;
        l->cfg.depth_step_m = cfg->range_step_m;
    }
    if (!cfg->n_squared)
        l->cfg.n_squared = cfg->nt;
    int err = lane_fft_create(&l->x, lane_fft_size(2 * cfg->nx));
    if (!err)
        err = lane_fft_create(&l->y, lane_fft_size(2 * cfg->ny));
    if (!err) {
        plan_squared(l);
        err = allocate(l);
    }
    if (!err)
        err = plan_resampling(l);
    if (!err)
        err = plan_transforms(l);
    if (!err)
        err = plan_kernel(l);
    if (err) {
        lightcone_destroy(l);
        return err;
    }
    *out = l;
    return 0;
}

void lightcone_destroy(struct lightcone *l)
{
    if (!l)
        return;
    fftwf_destroy_plan(l->forth);
    fftwf_destroy_plan(l->back);
    for (size_t t = 0; l->scratch && t < pool_threads(l->cfg.pool); t++) {
        struct scratch *s = &l->scratch[t];
        fftwf_free(s->bins);
        fftwf_free(s->cells);
        fftwf_free(s->columns);
        fftwf_free(s->numbers);
        fftwf_free(s->plane);
        fftwf_free(s->line);
    }
    free(l->scratch);
    free(l->fade_x);
    free(l->fade_y);
    fftwf_free(l->kernel);
    fftwf_free(l->damping);
    fftwf_free(l->spectrum);
    shares_destroy(l->volume_to_cells);
    shares_destroy(l->cells_to_volume);
    shares_destroy(l->bins_to_cells);
    shares_destroy(l->cells_to_bins);
    shares_destroy(l->inverse_to_cells);
    shares_destroy(l->inverse_to_volume);
    lane_fft_destroy(l->x);
    lane_fft_destroy(l->y);
    free(l);
}

/* -- a pass -----------------------------------------------------------------------------
 */

enum filter { FILTER_FORWARD, FILTER_ADJOINT, FILTER_WIENER };

struct pass { /* what the workers share */
    struct lightcone *l;
    enum filter filter;
    const float *in;
    float *out;
    const struct shares *to_cells, *from_cells;
};

/* -- rows -------------------------------------------------------------------------------
 */

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
    struct scratch *s = &l->scratch[thread];
    size_t nx = l->cfg.nx, nt = l->cfg.nt, pad = l->period - l->n_squared;
    if (p->filter == FILTER_FORWARD) {
        shares_apply(p->to_cells, p->in + iy * nx, nx * l->cfg.ny, nx, s->cells, nx);
    } else {
        transpose(p->in + iy * nx * nt, nt, nt, nx, s->bins, nx);
        shares_apply(p->to_cells, s->bins, nx, nx, s->cells, nx);
        if (p->filter == FILTER_WIENER && l->cfg.taper > 0.0)
            fade_row(l, iy, s->cells);
    }
    for (size_t ix = 0; ix < nx; ix += COLUMNS) {
        size_t n = nx - ix < COLUMNS ? nx - ix : COLUMNS;
        transpose(s->cells + ix, nx, n, l->n_squared, s->columns, l->period);
        for (size_t q = 0; q < n; q++) {
            memset(s->columns + q * l->period + l->n_squared, 0, pad * sizeof(float));
            transform_column(l, s, q, iy, ix + q);
        }
    }
}

static void restore_row(void *ctx, size_t iy, size_t thread)
{
    const struct pass *p = ctx;
    struct lightcone *l = p->l;
    struct scratch *s = &l->scratch[thread];
    size_t nx = l->cfg.nx, nt = l->cfg.nt;
    for (size_t ix = 0; ix < nx; ix += COLUMNS) {
        size_t n = nx - ix < COLUMNS ? nx - ix : COLUMNS;
        for (size_t q = 0; q < n; q++) {
            load_numbers(l, point_at(l, 0, iy, ix + q), s->numbers);
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
    struct scratch *s = &l->scratch[thread];
    size_t nx = l->cfg.nx;
    for (size_t iy = 0; iy < l->cfg.ny; iy++) {
        float *row = s->plane + iy * l->stride * LANE_FFT_POINT;
        load_line(row, point_at(l, block, iy, 0), LANE_FFT_POINT, nx, l->x->n / 2);
        lane_fft_forward(l->x, row);
    }
    filter_columns(p, block, s->plane, s->line);
    for (size_t iy = 0; iy < l->cfg.ny; iy++) {
        float *row = s->plane + iy * l->stride * LANE_FFT_POINT;
        lane_fft_backward(l->x, row);
        memcpy(point_at(l, block, iy, 0), row, nx * LANE_FFT_POINT * sizeof *row);
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
