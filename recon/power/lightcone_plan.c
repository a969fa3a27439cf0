#include "recon/power/lightcone_plan.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "dsp/fft.h"

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
        struct lightcone_scratch *s = &l->scratch[t];
        size_t numbers = l->n_blocks * VECTOR_LANES;
        s->bins = floats(c->nt * c->nx);
        s->cells = floats(l->n_squared * c->nx);
        s->columns = floats(LIGHTCONE_COLUMNS * l->period);
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
    struct lightcone_scratch *s = l->scratch;
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
        err = lightcone_plan_kernel(l);
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
        struct lightcone_scratch *s = &l->scratch[t];
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
