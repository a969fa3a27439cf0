/* SPDX-License-Identifier: MIT */
#include "recon/inverse/psf.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/window.h"
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
    long long cell[3]; /* of the midpoint, in SAME_M, on a stage that stands */
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
    const struct geometry *g = cfg->geometry, standing = geometry_standing(g);
    geometry_pair(&standing, number, p->speaker, p->microphone);
    for (int d = 0; d < 3; d++)
        p->cell[d] = llrint(0.5 * (p->speaker[d] + p->microphone[d]) / SAME_M);
    geometry_pair(g, number, p->speaker, p->microphone);
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
        double a = p->weight * window_hann_pulse(band_hz * late_s);
        re += a * cos(middle * late_s);
        im += a * sin(middle * late_s);
    }
    return re * re + im * im;
}

/* intensity [nz][ny][nx] of the point's image, 1 at the point: all pairs summed with
 * their phase in double precision.  0, -ENOMEM, -ECANCELED. */
static int sample_image(const struct psf_config *cfg, const struct grid *grid,
                        float *intensity)
{
    struct pair *pairs;
    size_t n;
    int err = list_pairs(&pairs, &n, cfg);
    if (err)
        return err;
    for (size_t v = 0; !err && v < grid_size(grid); v++) {
        size_t at[3];
        double m[3];
        if (cfg->stop && cfg->stop(cfg->stop_ctx))
            err = -ECANCELED;
        grid_place(grid, v, at);
        for (int d = 0; d < 3; d++)
            m[d] = grid->origin_m[d] + grid->step_m[d] * (double)at[d];
        intensity[v] = (float)level_at(cfg, pairs, n, m);
    }
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

/* -- the fit: a Gaussian with rotation to the image of a point --------------------------
 */

#define N       10    /* parameters: log peak, centre, precision */
#define STEPS   60    /* of the fit, at most */
#define SETTLED 1e-10 /* relative gain of a step that ends it */
#define BOX     1.6   /* half sizes of the box over the half widths at the level */
#define LARGEST 48    /* voxels from the peak, at most */
#define WIDEST  10.0  /* sigmas over the samples' reach: they differ by 1/2 % */
#define LEAST   1e-12 /* determinant over the diagonal's: less is rounding */

/* Amplitudes over the peak's, in voxels from the peak. */
struct samples {
    size_t n;
    double (*at)[3];
    double *amplitude;
    bool fixed[3]; /* axes without extent */
};

/* Voxels to the first below the level, along one axis and both ways. */
static size_t reach(const struct grid *g, const float *v, const size_t at[3], int axis)
{
    size_t stride[3] = {1, g->n[0], g->n[0] * g->n[1]};
    const float *peak = v + at[0] + at[1] * stride[1] + at[2] * stride[2];
    float level = (float)(PSF_FIT_LEVEL * PSF_FIT_LEVEL) * *peak;
    size_t up = 0, down = 0;
    while (at[axis] + up + 1 < g->n[axis] && up < LARGEST &&
           peak[up * stride[axis]] > level)
        up++;
    while (at[axis] > down && down<LARGEST &&*(peak - down * stride[axis])> level)
        down++;
    return (size_t)ceil(BOX * (double)(up > down ? up : down));
}

static int collect(struct samples *s, const struct grid *g, const float *v,
                   const size_t at[3])
{
    size_t low[3], n[3], all = 1;
    double peak = v[(at[2] * g->n[1] + at[1]) * g->n[0] + at[0]];
    for (int a = 0; a < 3; a++) {
        size_t r = reach(g, v, at, a);
        size_t high = at[a] + r + 1 < g->n[a] ? at[a] + r + 1 : g->n[a];
        low[a] = at[a] > r ? at[a] - r : 0;
        n[a] = high - low[a];
        all *= n[a];
        s->fixed[a] = g->n[a] == 1;
    }
    s->at = malloc(all * sizeof *s->at);
    s->amplitude = malloc(all * sizeof *s->amplitude);
    if (!s->at || !s->amplitude)
        return -ENOMEM;
    for (size_t i = 0; i < all; i++) {
        size_t p[3] = {low[0] + i % n[0], low[1] + i / n[0] % n[1],
                       low[2] + i / (n[0] * n[1])};
        double x = v[(p[2] * g->n[1] + p[1]) * g->n[0] + p[0]];
        if (!(x > PSF_FIT_LEVEL * PSF_FIT_LEVEL * peak))
            continue;
        for (int a = 0; a < 3; a++)
            s->at[s->n][a] = (double)p[a] - (double)at[a];
        s->amplitude[s->n++] = sqrt(x / peak);
    }
    return 0;
}

bool psf_invert(const double m[6], double out[6])
{
    double c00 = m[3] * m[5] - m[4] * m[4], c01 = m[2] * m[4] - m[1] * m[5];
    double c02 = m[1] * m[4] - m[2] * m[3], minor = m[0] * m[3] - m[1] * m[1];
    double det = m[0] * c00 + m[1] * c01 + m[2] * c02;
    if (!(m[0] > 0.0) || !(minor > LEAST * m[0] * m[3]) ||
        !(det > LEAST * m[0] * m[3] * m[5]) || !isfinite(det))
        return false;
    const double inverse[6] = {
        c00, c01, c02, m[0] * m[5] - m[2] * m[2], m[1] * m[2] - m[0] * m[4], minor};
    for (int q = 0; q < 6; q++)
        out[q] = inverse[q] / det;
    return true;
}

/* Model at one place and its slopes by the parameters. */
static double model(const double p[N], const double at[3], double slope[N])
{
    double d[3], pd[3], form = 0.0;
    for (int a = 0; a < 3; a++)
        d[a] = at[a] - p[1 + a];
    memset(pd, 0, sizeof pd);
    for (int q = 0; q < 6; q++) {
        int r = row_of[q], c = column_of[q];
        pd[r] += p[4 + q] * d[c];
        if (r != c)
            pd[c] += p[4 + q] * d[r];
    }
    for (int a = 0; a < 3; a++)
        form += d[a] * pd[a];
    double y = exp(p[0] - 0.5 * form);
    slope[0] = y;
    for (int a = 0; a < 3; a++)
        slope[1 + a] = y * pd[a];
    for (int q = 0; q < 6; q++) {
        int r = row_of[q], c = column_of[q];
        slope[4 + q] = -(r == c ? 0.5 : 1.0) * y * d[r] * d[c];
    }
    return y;
}

/* Sum of squared errors, and the normal equations when asked for. */
static double misfit(const struct samples *s, const double p[N], double normal[N][N],
                     double gradient[N])
{
    double sum = 0.0;
    if (normal) {
        memset(normal, 0, N * N * sizeof normal[0][0]);
        memset(gradient, 0, N * sizeof gradient[0]);
    }
    for (size_t i = 0; i < s->n; i++) {
        double slope[N];
        double e = s->amplitude[i] - model(p, s->at[i], slope);
        sum += e * e;
        for (int a = 0; normal && a < N; a++) {
            gradient[a] += e * slope[a];
            for (int b = 0; b < N; b++)
                normal[a][b] += slope[a] * slope[b];
        }
    }
    return sum;
}

/* An axis of one voxel keeps its place and a width that nothing depends on. */
static void hold(const struct samples *s, double normal[N][N], double gradient[N])
{
    for (int q = 0; q < N; q++) {
        bool held = q >= 1 && q <= 3 && s->fixed[q - 1];
        held = held ||
               (q >= 4 && (s->fixed[row_of[q - 4]] || s->fixed[column_of[q - 4]]));
        for (int k = 0; held && k < N; k++)
            normal[q][k] = normal[k][q] = 0.0;
        if (held) {
            normal[q][q] = 1.0;
            gradient[q] = 0.0;
        }
    }
}

/* Second moments of what stands above the level. */
static bool start(const struct samples *s, double p[N])
{
    double sum = 0.0, mean[3] = {0}, c[6] = {0};
    for (size_t i = 0; i < s->n; i++) {
        double w = s->amplitude[i] - PSF_FIT_LEVEL;
        sum += w;
        for (int a = 0; a < 3; a++)
            mean[a] += w * s->at[i][a];
    }
    for (int a = 0; a < 3; a++)
        mean[a] /= sum;
    for (size_t i = 0; i < s->n; i++)
        for (int q = 0; q < 6; q++)
            c[q] += (s->amplitude[i] - PSF_FIT_LEVEL) / sum *
                    (s->at[i][row_of[q]] - mean[row_of[q]]) *
                    (s->at[i][column_of[q]] - mean[column_of[q]]);
    for (int q = 0; q < 6; q++)
        if (row_of[q] == column_of[q] && s->fixed[row_of[q]])
            c[q] = 1.0;
    p[0] = 0.0;
    memcpy(p + 1, mean, sizeof mean);
    return psf_invert(c, p + 4);
}

static int fit(const struct samples *s, double p[N], double *residual)
{
    double normal[N][N], gradient[N], step[N], next[N], unused[6], damping = 1e-3;
    if (s->n < N || !start(s, p))
        return -ERANGE;
    double cost = misfit(s, p, normal, gradient);
    for (int i = 0; i < STEPS; i++) {
        hold(s, normal, gradient);
        double damped[N][N];
        memcpy(damped, normal, sizeof damped);
        for (int q = 0; q < N; q++)
            damped[q][q] *= 1.0 + damping;
        memcpy(step, gradient, sizeof step);
        if (normal_equations_solve(N, damped[0], step, 0.0))
            return -ERANGE;
        for (int q = 0; q < N; q++)
            next[q] = p[q] + step[q];
        double lower = psf_invert(next + 4, unused) ? misfit(s, next, NULL, NULL)
                                                    : INFINITY;
        if (!(lower < cost)) {
            damping *= 8.0;
            if (damping > 1e12)
                break;
            continue;
        }
        bool settled = cost - lower <= SETTLED * cost;
        memcpy(p, next, sizeof next);
        cost = misfit(s, p, normal, gradient);
        damping *= 0.2;
        if (settled)
            break;
    }
    *residual = sqrt(cost / (double)s->n) / exp(p[0]);
    return 0;
}

/* Its top is among the samples, and it falls towards their ends. */
static bool is_peak(const struct samples *s, const double p[N], const double c[6])
{
    static const int diagonal[3] = {0, 3, 5};
    for (int a = 0; a < 3; a++) {
        double reach = 0.0;
        for (size_t i = 0; i < s->n; i++)
            reach = fmax(reach, fabs(s->at[i][a]));
        if (!s->fixed[a] &&
            !(fabs(p[1 + a]) <= reach && sqrt(c[diagonal[a]]) <= WIDEST * reach))
            return false;
    }
    return true;
}

int psf_fit(struct psf *out, const struct grid *g, const float *intensity, size_t voxel)
{
    size_t at[3];
    struct samples s = {0};
    double p[N], c[6];
    if (voxel >= grid_size(g) || !(intensity[voxel] > 0.0f) ||
        !isfinite(intensity[voxel]))
        return -EINVAL;
    grid_place(g, voxel, at);
    memset(out, 0, sizeof *out);
    int err = collect(&s, g, intensity, at);
    if (!err)
        err = fit(&s, p, &out->residual);
    if (!err && !(psf_invert(p + 4, c) && is_peak(&s, p, c)))
        err = -ERANGE;
    if (!err) {
        for (int a = 0; a < 3; a++)
            out->centre_m[a] = g->origin_m[a] + g->step_m[a] * ((double)at[a] + p[1 + a]);
        for (int q = 0; q < 6; q++)
            out->covariance_m2[q] = s.fixed[row_of[q]] || s.fixed[column_of[q]]
                                        ? 0.0
                                        : c[q] * g->step_m[row_of[q]] *
                                              g->step_m[column_of[q]];
        out->peak = intensity[voxel] * exp(2.0 * p[0]);
        out->n_voxels = s.n;
    }
    free(s.at);
    free(s.amplitude);
    return err;
}
