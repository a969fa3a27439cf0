#include "recon/inverse/psf.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "recon/hann.h"
#include "recon/inverse/symmetric.h"

#define WIDTH_SIGMAS  2.35482 /* exp(-1/2 d^2) is above 1/2 over 2 sqrt(2 ln 2) */
#define SAME_M        1e-3    /* midpoints closer than this are one */
#define GRID_HALF     6       /* voxels of psf_compute's grid on each side of the point */
#define GRID_SIGMAS   0.3     /* their step in standard deviations */
#define COMPUTE_PAIRS 4096    /* enough for the main lobe of any aperture */
#define LEAST_ROOT    1e-3    /* of the sharpest axis: below it one is not resolved */

static const int row_of[6] = {0, 0, 0, 1, 1, 2}, column_of[6] = {0, 1, 2, 1, 2, 2};

/* -- pairs ------------------------------------------------------------------------------
 */

struct pair {
    double speaker[3], microphone[3];
    long long cell[3]; /* of the midpoint, in SAME_M */
    double delay_s, weight;
};

static int by_cell(const void *a, const void *b)
{
    const struct pair *p = a, *q = b;
    for (int d = 0; d < 3; d++)
        if (p->cell[d] != q->cell[d])
            return p->cell[d] < q->cell[d] ? -1 : 1;
    return 0;
}

static void fill_pair(struct pair *p, const struct psf_config *cfg, size_t number)
{
    const struct geometry *g = cfg->geometry;
    geometry_pair(g, number, p->speaker, p->microphone);
    for (int d = 0; d < 3; d++)
        p->cell[d] = llrint(0.5 * (p->speaker[d] + p->microphone[d]) / SAME_M);
    double near = geometry_distance(p->speaker, cfg->at_m);
    double far = geometry_distance(p->microphone, cfg->at_m);
    p->delay_s = (near + far) / g->sound_speed_m_s;
    p->weight = 1.0 / fmax(near * far, 1e-12);
}

/* Evenly spread over all pairs, each weighted by spreading over the number that share its
 * midpoint.  The weights sum to 1. */
static int list_pairs(struct pair **out, size_t *n, const struct psf_config *cfg)
{
    const struct geometry *g = cfg->geometry;
    size_t all = g->n_positions * g->n_speakers * g->n_microphones;
    double sum = 0.0;
    *n = cfg->n_pairs && cfg->n_pairs < all ? cfg->n_pairs : all;
    struct pair *pairs = malloc(*n * sizeof *pairs);
    if (!pairs)
        return -ENOMEM;
    /* steps of the golden section meet no pattern of the array */
    for (size_t i = 0; i < *n; i++) {
        double turn = (double)i * 0.6180339887498949;
        size_t spread = (size_t)((turn - floor(turn)) * (double)all);
        fill_pair(&pairs[i], cfg, *n == all ? i : spread);
    }
    qsort(pairs, *n, sizeof *pairs, by_cell);
    for (size_t i = 0, end; i < *n; i = end) {
        for (end = i; end < *n && by_cell(&pairs[i], &pairs[end]) == 0; end++)
            ;
        for (size_t k = i; k < end; k++)
            sum += pairs[k].weight /= (double)(end - i);
    }
    for (size_t i = 0; i < *n; i++)
        pairs[i].weight /= sum;
    *out = pairs;
    return 0;
}

/* -- images -----------------------------------------------------------------------------
 */

static double level_at(const struct psf_config *cfg, const struct pair *pairs, size_t n,
                       const double at[3])
{
    double band_hz = cfg->band_hz[1] - cfg->band_hz[0], re = 0.0, im = 0.0;
    double middle = M_PI * (cfg->band_hz[0] + cfg->band_hz[1]);
    for (size_t i = 0; i < n; i++) {
        const struct pair *p = &pairs[i];
        double late_s =
            (geometry_distance(p->speaker, at) + geometry_distance(p->microphone, at)) /
                cfg->geometry->sound_speed_m_s -
            p->delay_s;
        double a = p->weight * hann_pulse(band_hz * late_s);
        re += a * cos(middle * late_s);
        im += a * sin(middle * late_s);
    }
    return re * re + im * im;
}

/* intensity [nz][ny][nx] of the point's image, 1 at the point: all pairs summed with
 * their phase in double precision.  0, -ENOMEM. */
static int sample_image(const struct psf_config *cfg, const struct grid *grid,
                        float *intensity)
{
    struct pair *pairs;
    size_t n;
    int err = list_pairs(&pairs, &n, cfg);
    for (size_t v = 0; !err && v < grid_size(grid); v++) {
        size_t at[3];
        double m[3];
        grid_place(grid, v, at);
        for (int d = 0; d < 3; d++)
            m[d] = grid->origin_m[d] + grid->step_m[d] * (double)at[d];
        intensity[v] = (float)level_at(cfg, pairs, n, m);
    }
    if (!err)
        free(pairs);
    return err;
}

/* Wave vector of a pair per frequency: how its delay grows with the position. */
static void delay_slope(const struct psf_config *cfg, const struct pair *p, double out[3])
{
    double near = fmax(geometry_distance(p->speaker, cfg->at_m), 1e-12);
    double far = fmax(geometry_distance(p->microphone, cfg->at_m), 1e-12);
    for (int d = 0; d < 3; d++)
        out[d] = ((cfg->at_m[d] - p->speaker[d]) / near +
                  (cfg->at_m[d] - p->microphone[d]) / far) *
                 2.0 * M_PI / cfg->geometry->sound_speed_m_s;
}

/* |sum of exp(i k d)| = 1 - 1/2 d' Cov(k) d: Cov(k) over pairs and band is C^-1. */
static void closed_form(const struct psf_config *cfg, const struct pair *pairs, size_t n,
                        double precision[6])
{
    double mid_hz = 0.5 * (cfg->band_hz[0] + cfg->band_hz[1]), mean[3] = {0};
    double variance = HANN_VARIANCE * pow(cfg->band_hz[1] - cfg->band_hz[0], 2.0);
    memset(precision, 0, 6 * sizeof *precision);
    for (size_t i = 0; i < n; i++) {
        double k[3];
        delay_slope(cfg, &pairs[i], k);
        for (int d = 0; d < 3; d++)
            mean[d] += pairs[i].weight * k[d] * mid_hz;
        for (int q = 0; q < 6; q++)
            precision[q] += pairs[i].weight * k[row_of[q]] * k[column_of[q]] *
                            (mid_hz * mid_hz + variance);
    }
    for (int q = 0; q < 6; q++)
        precision[q] -= mean[row_of[q]] * mean[column_of[q]];
}

int psf_curvature(const struct psf_config *cfg, double covariance_m2[6])
{
    struct pair *pairs;
    double precision[6];
    size_t n;
    int err = list_pairs(&pairs, &n, cfg);
    if (err)
        return err;
    closed_form(cfg, pairs, n, precision);
    free(pairs);
    return psf_invert(precision, covariance_m2) ? 0 : -ERANGE;
}

/* However they lie. */
static size_t resolved_axes(const double precision[6])
{
    double value[3], axes[3][3];
    size_t n = 0;
    symmetric_axes(precision, value, axes);
    for (int a = 0; a < 3; a++)
        n += value[a] > LEAST_ROOT * LEAST_ROOT * value[0];
    return n;
}

/* The middle of the grid is the point; an axis that nothing resolves has one voxel. */
static int fit_grid(struct grid *out, const struct psf_config *cfg)
{
    struct pair *pairs;
    double precision[6], most = 0.0;
    size_t n;
    static const int diagonal[3] = {0, 3, 5};
    int err = list_pairs(&pairs, &n, cfg);
    if (err)
        return err;
    closed_form(cfg, pairs, n, precision);
    free(pairs);
    for (int d = 0; d < 3; d++)
        most = fmax(most, precision[diagonal[d]]);
    for (int d = 0; d < 3; d++) {
        double own = precision[diagonal[d]];
        bool wide = own > LEAST_ROOT * LEAST_ROOT * most && own > 0.0;
        out->n[d] = wide ? 2 * GRID_HALF + 1 : 1;
        out->step_m[d] = wide ? GRID_SIGMAS / sqrt(own) : 1.0;
        out->origin_m[d] = cfg->at_m[d] - out->step_m[d] * (double)(out->n[d] / 2);
    }
    return resolved_axes(precision) >= 2 ? 0 : -ERANGE;
}

int psf_compute(struct psf *out, const struct psf_config *cfg, struct grid *grid,
                float **intensity)
{
    struct psf_config some = *cfg;
    struct grid own;
    if (!some.n_pairs)
        some.n_pairs = COMPUTE_PAIRS;
    int err = fit_grid(&own, &some);
    if (err)
        return err;
    float *image = malloc(grid_size(&own) * sizeof *image);
    if (!image)
        return -ENOMEM;
    err = sample_image(&some, &own, image);
    if (!err)
        err = psf_fit(out, &own, image, grid_size(&own) / 2);
    if (grid)
        *grid = own;
    if (!err && intensity)
        *intensity = image;
    else
        free(image);
    return err;
}

/* -- widths -----------------------------------------------------------------------------
 */

void psf_widths(const struct psf *p, double width_m[3])
{
    static const int diagonal[3] = {0, 3, 5};
    double inverse[6];
    for (int a = 0; a < 3; a++)
        width_m[a] = WIDTH_SIGMAS *
                     (psf_invert(p->covariance_m2, inverse)
                          ? 1.0 / sqrt(inverse[diagonal[a]])
                          : sqrt(fmax(p->covariance_m2[diagonal[a]], 0.0)));
}

void psf_axes(const struct psf *p, double width_m[3], double axes[3][3])
{
    double value[3];
    symmetric_axes(p->covariance_m2, value, axes);
    for (int a = 0; a < 3; a++)
        width_m[a] = WIDTH_SIGMAS * sqrt(fmax(value[a], 0.0));
}
