/* SPDX-License-Identifier: MIT */
#include "recon/coherent/fk_plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/fft.h"
#include "recon/coherent/sinc.h"

#define TIME_PADDING  1.9 /* keeps the spectrum smooth enough for FK_TAPS taps */
#define APERTURE_SINE 0.5 /* steeper waves add smear and aliases, hardly resolution */
#define STEEPEST_SINE 0.9
#define PERIOD_MARGIN 1.2
#define DEPTH_PADDING                                                                    \
    1.15 /* keeps what migrates below the grid from wrapping into it                     \
          */

/* Short transforms cost nothing, and the farther away copies are the better; but a long
 * step makes a long way of them. */
#define SHORT      48
#define SHORT_WAYS 4.0 /* what is needed, in shorter ones */
#define LONE_WAYS  1.2 /* the same of a voxel whose step is ours to choose */
#define MOST       1e7 /* places or frequencies: more are none that anybody images */

/* Lengths at which FFTW's estimated plan is as good as a measured one (3.3.10, under 1.2
 * ns a point; others take up to 4).  All even. */
static size_t fast_size(double needed)
{
    static const size_t lengths[] = {8,   16,  24,  32,   SHORT, 64,  80,  96,
                                     128, 144, 160, 192,  240,   256, 320, 384,
                                     400, 512, 640, 1024, 1280,  2048};
    double at_least = fmax(needed, fmin(SHORT, SHORT_WAYS * needed));
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++)
        if ((double)lengths[i] >= at_least)
            return lengths[i];
    return 2 * fft_size((size_t)ceil(0.5 * at_least), 1.1);
}

/* A lone voxel's step may be as short as makes `needed_m` a short transform. */
static double lone_step(double step_m, double needed_m)
{
    return needed_m > 0.0 ? fmin(step_m, LONE_WAYS / SHORT * needed_m) : step_m;
}

/* What the image takes of a period; a lone voxel takes none, however long its step. */
static double extent(const struct grid *g, int axis)
{
    return g->n[axis] > 1 ? (double)g->n[axis] * g->step_m[axis] : 0.0;
}

/* The smallest line, or the largest. */
static double end_line(const double *lines, size_t n, bool largest)
{
    double end = lines[0];
    for (size_t i = 1; i < n; i++)
        end = largest ? fmax(end, lines[i]) : fmin(end, lines[i]);
    return end;
}

static double grid_end(const struct grid *g, int axis)
{
    return g->origin_m[axis] + (double)(g->n[axis] - 1) * g->step_m[axis];
}

/* Farthest lateral distance between a line of midpoints and the image. */
static double reach(const struct grid *g, int axis, const double *lines, size_t n)
{
    return fmax(grid_end(g, axis) - end_line(lines, n, false),
                end_line(lines, n, true) - g->origin_m[axis]);
}

static int plan_axis(struct fk_axis *a, struct fk *m, int axis, const double *lines,
                     size_t n, double k_limit)
{
    struct grid *g = &m->grid;
    double aperture = end_line(lines, n, true) - end_line(lines, n, false);
    double across = fabs(reach(g, axis, lines, n));
    /* Copies of the midpoints stand a period away.  They must lie outside the cone of
     * waves used; those of a wide aperture are out of focus and may lie nearer. */
    double period = aperture > 0.5 * across ? PERIOD_MARGIN * 2.0 * across
                                            : across + m->sine_max * m->far_m;
    period = fmax(period, extent(g, axis) + aperture);
    if (g->n[axis] == 1)
        g->step_m[axis] = lone_step(g->step_m[axis], period);
    double step = g->step_m[axis], places = fmax(period / step, (double)g->n[axis]);
    if (!(places <= MOST) || !(k_limit * places * step <= 2.0 * M_PI * MOST))
        return -EINVAL;
    a->n = fast_size(places);
    a->dk = 2.0 * M_PI / ((double)a->n * step);
    a->k_max = (size_t)floor(k_limit / a->dk);
    a->kept = 2 * a->k_max + 1 < a->n ? 2 * a->k_max + 1 : a->n;
    a->lines = n;
    a->cosine = malloc((a->k_max + 1) * n * sizeof *a->cosine);
    a->sine = malloc((a->k_max + 1) * n * sizeof *a->sine);
    if (!a->cosine || !a->sine)
        return -ENOMEM;
    for (size_t k = 0; k <= a->k_max; k++) {
        for (size_t b = 0; b < n; b++) {
            double phase = (double)k * a->dk * (lines[b] - g->origin_m[axis]);
            a->cosine[k * n + b] = (float)cos(phase);
            a->sine[k * n + b] = (float)sin(phase);
        }
    }
    return 0;
}

static void plan_time(struct fk *m, const struct fk_config *cfg)
{
    const struct trace_format *t = &cfg->trace;
    m->nt_fft = fast_size(TIME_PADDING * (double)t->n_samples);
    m->df_hz = t->rate_hz / (double)m->nt_fft;
    double half_band = 0.5 * fmin(t->rate_hz, cfg->band_hz[1] - cfg->band_hz[0]);
    double centre_hz = 0.5 * (cfg->band_hz[0] + cfg->band_hz[1]) - t->carrier_hz;
    m->first_bin = (long)floor((centre_hz - half_band) / m->df_hz) - FK_TAPS;
    long last_bin = (long)ceil((centre_hz + half_band) / m->df_hz) + FK_TAPS;
    m->n_f = (size_t)(last_bin - m->first_bin + FK_X_BLOCK) / FK_X_BLOCK * FK_X_BLOCK;
    m->f0_hz = t->carrier_hz + (double)m->first_bin * m->df_hz;
    m->centre_s = t->t0_s + 0.5 * (double)(t->n_samples - 1) / t->rate_hz;
}

static void plan_depth(struct fk *m, const struct fk_config *cfg)
{
    m->far_m = 0.5 * m->c *
               (m->centre_s + 0.5 * (double)cfg->trace.n_samples / cfg->trace.rate_hz);
    double near_m = 0.5 * m->c * cfg->trace.t0_s, deep_m = extent(&m->grid, 2);
    double span = DEPTH_PADDING * fmax(deep_m, m->far_m - m->depth_m);
    span = fmax(span, deep_m + m->depth_m - near_m); /* nor what migrates above it */
    if (m->grid.n[2] == 1)
        m->grid.step_m[2] = lone_step(m->grid.step_m[2], span);
    double step = m->grid.step_m[2];
    m->nz_fft = fast_size(span / step);
    m->dkz = 2.0 * M_PI / ((double)m->nz_fft * step);
    double cosine = sqrt(1.0 - m->sine_max * m->sine_max);
    double k_low = 4.0 * M_PI * cfg->band_hz[0] / m->c;
    double k_high = 4.0 * M_PI * cfg->band_hz[1] / m->c;
    m->kz_first = (long)ceil(k_low * cosine / m->dkz);
    m->n_kz = (size_t)(floor(k_high / m->dkz) - (double)m->kz_first + 1.0);
}

/* Of the upper half of what lies between; 1 below. */
static double soft_end(double k, double k_low, double k_high)
{
    double past = (k - 0.5 * (k_low + k_high)) / (0.5 * (k_high - k_low));
    return past > 0.0 ? 0.5 + 0.5 * cos(M_PI * fmin(past, 1.0)) : 1.0;
}

static int plan_tables(struct fk *m, const struct fk_config *cfg)
{
    m->weights = fftwf_malloc(FK_FRACTIONS * FK_TAPS * sizeof *m->weights);
    m->centring = malloc(2 * m->n_f * sizeof *m->centring);
    m->gain = malloc(m->n_kz * sizeof *m->gain);
    if (!m->weights || !m->centring || !m->gain)
        return -ENOMEM;
    double k_low = 4.0 * M_PI * cfg->band_hz[0] / m->c;
    double k_high = 4.0 * M_PI * cfg->band_hz[1] / m->c;
    for (size_t z = 0; z < m->n_kz; z++) {
        double kz = (double)(m->kz_first + (long)z) * m->dkz;
        double gain = sqrt(kz) * pow(kz / k_high, cfg->sharpen);
        m->gain[z] = (float)(cfg->taper ? gain * soft_end(kz, k_low, k_high) : gain);
    }
    for (size_t q = 0; q < m->n_f; q++) {
        double f_hz = (double)(m->first_bin + (long)q) * m->df_hz;
        double phase = 2.0 * M_PI * f_hz * (m->centre_s - m->trace.t0_s);
        m->centring[2 * q] = (float)cos(phase);
        m->centring[2 * q + 1] = (float)sin(phase);
    }
    for (size_t f = 0; f < FK_FRACTIONS; f++) {
        double w[FK_TAPS];
        sinc_weights(FK_TAPS, 1.0 / TIME_PADDING, (double)f / FK_FRACTIONS, w);
        for (int q = 0; q < FK_TAPS; q++)
            m->weights[f * FK_TAPS + (size_t)q] = (float)w[q];
    }
    return 0;
}

/* Of folds: as many as share the reading of the spectrum, but enough groups that no
 * thread waits long for the last one. */
static size_t group_size(const struct fk *m)
{
    size_t each = (m->x.kept / 2 + 1) / (4 * pool_threads(m->pool));
    return each < 1 ? 1 : each < FK_GROUP ? each : FK_GROUP;
}

static int allocate(struct fk *m, const size_t (*x_range)[2])
{
    m->folds = group_size(m);
    const size_t *n = m->grid.n;
    m->spectrum =
        fftwf_malloc(m->x.lines * m->y.lines * m->n_f * 2 * sizeof *m->spectrum);
    m->x_range = malloc(m->y.lines * sizeof *m->x_range);
    m->half = fftwf_malloc(m->x.kept * n[1] * n[2] * sizeof *m->half);
    m->scratch = calloc(pool_threads(m->pool), sizeof *m->scratch);
    if (!m->spectrum || !m->x_range || !m->half || !m->scratch)
        return -ENOMEM;
    for (size_t y = 0; y < m->y.lines; y++) {
        m->x_range[y][0] = x_range ? x_range[y][0] : 0;
        m->x_range[y][1] = x_range ? x_range[y][1] : m->x.lines;
    }
    for (size_t t = 0; t < pool_threads(m->pool); t++) {
        struct fk_scratch *s = &m->scratch[t];
        s->waves = malloc((m->x.k_max + 1) * sizeof *s->waves);
        s->rows = fftwf_malloc(FK_GROUP * m->y.lines * m->n_f * 4 * sizeof *s->rows);
        s->quads = fftwf_malloc(FK_GROUP * m->n_f * 8 * sizeof *s->quads);
        s->bin = malloc(m->n_kz * sizeof *s->bin);
        s->fraction = malloc(m->n_kz * sizeof *s->fraction);
        s->phase_re = malloc(m->n_kz * sizeof *s->phase_re);
        s->phase_im = malloc(m->n_kz * sizeof *s->phase_im);
        s->plane = fftwf_malloc(2 * m->y.n * m->n_kz * sizeof *s->plane);
        s->line_image = fftwf_malloc(m->x.n * sizeof *s->line_image);
        s->plane_image = fftwf_malloc(m->y.n * m->n_kz * sizeof *s->plane_image);
        s->column_image = fftwf_malloc(m->nz_fft * sizeof *s->column_image);
        s->trace_spectrum = fftwf_malloc(m->nt_fft * sizeof *s->trace_spectrum);
        s->column = fftwf_malloc(m->nz_fft * sizeof *s->column);
        s->line = fftwf_malloc(n[2] * m->x.n * sizeof *s->line);
        s->trace = fftwf_malloc(m->nt_fft * sizeof *s->trace);
        if (!s->waves || !s->rows || !s->quads || !s->bin || !s->fraction ||
            !s->phase_re || !s->phase_im || !s->plane || !s->plane_image ||
            !s->column_image || !s->trace_spectrum || !s->column || !s->line ||
            !s->line_image || !s->trace)
            return -ENOMEM;
        memset(s->line, 0, n[2] * m->x.n * sizeof *s->line);
    }
    return 0;
}

/* Plans by rule, not by measurement: a measured plan depends on what else the machine
 * does, and another plan rounds otherwise.  The same recording is to give the same bytes.
 */
static int plan_transforms(struct fk *m)
{
    struct fk_scratch *s = m->scratch;
    int ny = (int)m->y.n, nx = (int)m->x.n, kz = (int)m->n_kz;
    const unsigned flags = FFTW_ESTIMATE;
    m->time_plan = fftwf_plan_dft_1d((int)m->nt_fft, s->trace, s->trace_spectrum,
                                     FFTW_FORWARD, flags);
    m->z_plan = fftwf_plan_dft_1d((int)m->nz_fft, s->column, s->column_image,
                                  FFTW_BACKWARD, flags);
    m->y_plan = fftwf_plan_many_dft(1, &ny, kz, s->plane, NULL, kz, 1, s->plane_image,
                                    NULL, kz, 1, FFTW_BACKWARD, flags);
    m->x_plan = fftwf_plan_dft_1d(nx, s->line, s->line_image, FFTW_BACKWARD, flags);
    return m->time_plan && m->z_plan && m->y_plan && m->x_plan ? 0 : -ENOMEM;
}

/* How far the image reaches beyond the midpoints, and on to their middle. */
static double beyond(const struct grid *g, int axis, const double *lines, size_t n)
{
    double first = end_line(lines, n, false), last = end_line(lines, n, true);
    double outside = fmax(first - g->origin_m[axis], grid_end(g, axis) - last);
    double half = 0.5 * (last - first);
    return outside > half ? outside + half : 0.0;
}

/* Of the steepest waves used: those of a cone that each voxel sees the midpoints in, of
 * the middle of the image all along an axis, or what it takes to see them at all, but not
 * more than there is. */
static double steepest_sine(const struct fk *m, const struct fk_config *cfg)
{
    const struct grid *g = &m->grid;
    double across[2] = {reach(g, 0, cfg->x_m, cfg->nx), reach(g, 1, cfg->y_m, cfg->ny)};
    double all = hypot(across[0], across[1]), along = fmax(across[0], across[1]);
    double side = hypot(beyond(g, 0, cfg->x_m, cfg->nx), beyond(g, 1, cfg->y_m, cfg->ny));
    double middle_m = m->depth_m + 0.5 * (double)(g->n[2] - 1) * g->step_m[2];
    double needed = fmax(side / hypot(side, m->depth_m), APERTURE_SINE);
    needed = fmax(needed, along / hypot(along, middle_m));
    return fmin(fmin(needed, all / hypot(all, m->depth_m)), STEEPEST_SINE);
}

int fk_create(struct fk **out, const struct fk_config *cfg)
{
    double depth_m = cfg->grid.origin_m[2] - cfg->plane_z_m;
    if (!cfg->nx || !cfg->ny || !grid_size(&cfg->grid) || !(depth_m > 0.0) ||
        cfg->trace.n_samples < FK_MIN_SAMPLES || !(cfg->trace.rate_hz > 0.0) ||
        !(cfg->sound_speed_m_s > 0.0) || !(cfg->band_hz[1] > cfg->band_hz[0]) ||
        !(cfg->sharpen >= 0.0))
        return -EINVAL;
    for (int a = 0; a < 3; a++)
        if (!(cfg->grid.step_m[a] > 0.0))
            return -EINVAL;
    if (!((cfg->band_hz[1] + fabs(cfg->trace.carrier_hz)) *
              (double)cfg->trace.n_samples <=
          MOST * cfg->trace.rate_hz))
        return -EINVAL;
    struct fk *m = calloc(1, sizeof *m);
    if (!m)
        return -ENOMEM;
    m->c = cfg->sound_speed_m_s;
    m->grid = cfg->grid;
    m->trace = cfg->trace;
    m->pool = cfg->pool;
    m->depth_m = depth_m;
    m->sine_max = steepest_sine(m, cfg);
    plan_time(m, cfg);
    plan_depth(m, cfg);
    double k_limit = m->sine_max * 4.0 * M_PI * cfg->band_hz[1] / m->c;
    int err = plan_axis(&m->x, m, 0, cfg->x_m, cfg->nx, k_limit);
    if (!err)
        err = plan_axis(&m->y, m, 1, cfg->y_m, cfg->ny, k_limit);
    /* A sum over wavenumbers is an integral times their spacing, whatever the grid; over
     * the space they fill, so that a gain of 1e12 is no overflow. */
    double k_high = 4.0 * M_PI * cfg->band_hz[1] / m->c;
    size_t covering = cfg->nx / (cfg->copies > 1 ? cfg->copies : 1);
    double spacing = m->x.dk * m->y.dk * m->dkz / (double)(covering * cfg->ny);
    m->scale = (float)(spacing / pow(k_high, 3.5));
    if (!err)
        err = plan_tables(m, cfg);
    if (!err)
        err = allocate(m, cfg->x_range);
    if (!err)
        err = plan_transforms(m);
    if (err) {
        fk_destroy(m);
        return err;
    }
    *out = m;
    return 0;
}

static void free_scratch(struct fk_scratch *s)
{
    free(s->waves);
    fftwf_free(s->rows);
    fftwf_free(s->quads);
    free(s->bin);
    free(s->fraction);
    free(s->phase_re);
    free(s->phase_im);
    fftwf_free(s->plane);
    fftwf_free(s->plane_image);
    fftwf_free(s->column_image);
    fftwf_free(s->trace_spectrum);
    fftwf_free(s->column);
    fftwf_free(s->line);
    fftwf_free(s->line_image);
    fftwf_free(s->trace);
}

void fk_destroy(struct fk *m)
{
    if (!m)
        return;
    fftwf_destroy_plan(m->time_plan);
    fftwf_destroy_plan(m->y_plan);
    fftwf_destroy_plan(m->z_plan);
    fftwf_destroy_plan(m->x_plan);
    for (size_t t = 0; m->scratch && t < pool_threads(m->pool); t++)
        free_scratch(&m->scratch[t]);
    free(m->scratch);
    fftwf_free(m->weights);
    free(m->centring);
    free(m->gain);
    fftwf_free(m->spectrum);
    free(m->x_range);
    fftwf_free(m->half);
    free(m->x.cosine);
    free(m->x.sine);
    free(m->y.cosine);
    free(m->y.sine);
    free(m);
}
