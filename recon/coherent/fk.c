/* SPDX-License-Identifier: MIT */
#include "recon/coherent/fk.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FFTW_NO_Complex /* fftwf_complex is float[2], also beside <complex.h> */
#include <fftw3.h>

#include "dsp/fft.h"
#include "dsp/vector.h"
#include "recon/coherent/phasor.h"
#include "recon/coherent/sinc.h"

#define TIME_PADDING  1.9 /* keeps the spectrum smooth enough for TAPS taps */
#define APERTURE_SINE 0.5 /* steeper waves add smear and aliases, hardly resolution */
#define STEEPEST_SINE 0.9
#define PERIOD_MARGIN 1.2
#define DEPTH_PADDING                                                                    \
    1.15 /* keeps what migrates below the grid from wrapping into it                     \
          */

#define TAPS      8   /* of the interpolation along frequency */
#define FRACTIONS 512 /* steps of its table between two bins */

#define BLOCK   32          /* floats that are summed over all lines before the next */
#define X_BLOCK (BLOCK / 2) /* frequencies of a block: re im */
#define Y_BLOCK (BLOCK / 4) /* +kx re im, -kx re im */
#define GROUP   4 /* wavenumbers that are summed while a block is in the cache */

struct axis {     /* one lateral axis */
    size_t n;     /* length of the transform: period / step */
    double dk;    /* rad/m */
    size_t k_max; /* largest wavenumber index used, either sign */
    size_t kept;  /* of the transform's wavenumbers those that hold any, of either sign */
    size_t lines;
    float *cosine, *sine; /* [k_max + 1][lines], of k (line - origin) */
};

struct wave {         /* +-kx */
    size_t kx, fold;  /* fold: |kx| of the image's transform */
    size_t first_bin; /* of the spectrum that it needs */
};

struct scratch {                   /* one a thread */
    struct wave *waves;            /* [x.k_max + 1] */
    float *rows;                   /* [GROUP][n_f / Y_BLOCK][y lines][BLOCK] */
    float *quads;                  /* [GROUP][n_f][8]: re im of ++ +- -+ -- */
    int *bin, *fraction;           /* [n_kz] of Stolt's map */
    float *phase_re, *phase_im;    /* [n_kz] */
    fftwf_complex *plane;          /* [2][y.n][n_kz] */
    fftwf_complex *plane_image;    /* [y.n][n_kz]: in y */
    fftwf_complex *column;         /* [nz_fft] */
    fftwf_complex *column_image;   /* [nz_fft]: in z */
    fftwf_complex *line;           /* [grid nz][x.n], 0 where none is kept */
    fftwf_complex *line_image;     /* [x.n]: in x */
    fftwf_complex *trace;          /* [nt_fft] */
    fftwf_complex *trace_spectrum; /* [nt_fft] */
};

struct fk {
    double c;
    struct grid grid;
    struct trace_format trace;
    struct pool *pool;
    double sine_max; /* of the steepest angle used */

    size_t nt_fft;       /* of the transform over time */
    double df_hz, f0_hz; /* spectrum bin q is at f0_hz + q df_hz */
    size_t n_f;          /* a multiple of X_BLOCK */
    long first_bin;      /* bin 0 of the spectrum in FFT order, may be negative */
    double centre_s;     /* time origin of the spectrum: the middle of the traces */
    double far_m;        /* range of the traces' end */
    double depth_m;      /* of the grid's first plane below the midpoints */

    struct axis x, y;
    size_t folds;         /* that a thread takes at a time */
    size_t (*x_range)[2]; /* [y lines]: of each the lines of x that have traces */
    size_t nz_fft;
    double dkz;
    long kz_first;
    size_t n_kz;
    float scale; /* of amplitudes */

    float *centring;     /* [n_f][2]: phase that moves the origin of time to centre_s */
    float *gain;         /* [n_kz] */
    float *weights;      /* [FRACTIONS][TAPS] */
    float *spectrum;     /* [n_f / X_BLOCK][y lines][x lines][BLOCK] */
    fftwf_complex *half; /* [x.kept][grid ny][grid nz]: imaged in y and z, not in x */
    struct scratch *scratch;
    fftwf_plan time_plan, y_plan, z_plan, x_plan;
};

/* -- sizes, wavenumbers and tables, made once -------------------------------------------
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

static int plan_axis(struct axis *a, struct fk *m, int axis, const double *lines,
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
    m->first_bin = (long)floor((centre_hz - half_band) / m->df_hz) - TAPS;
    long last_bin = (long)ceil((centre_hz + half_band) / m->df_hz) + TAPS;
    m->n_f = (size_t)(last_bin - m->first_bin + X_BLOCK) / X_BLOCK * X_BLOCK;
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
    m->weights = fftwf_malloc(FRACTIONS * TAPS * sizeof *m->weights);
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
    for (size_t f = 0; f < FRACTIONS; f++) {
        double w[TAPS];
        sinc_weights(TAPS, 1.0 / TIME_PADDING, (double)f / FRACTIONS, w);
        for (int q = 0; q < TAPS; q++)
            m->weights[f * TAPS + (size_t)q] = (float)w[q];
    }
    return 0;
}

/* Of folds: as many as share the reading of the spectrum, but enough groups that no
 * thread waits long for the last one. */
static size_t group_size(const struct fk *m)
{
    size_t each = (m->x.kept / 2 + 1) / (4 * pool_threads(m->pool));
    return each < 1 ? 1 : each < GROUP ? each : GROUP;
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
        struct scratch *s = &m->scratch[t];
        s->waves = malloc((m->x.k_max + 1) * sizeof *s->waves);
        s->rows = fftwf_malloc(GROUP * m->y.lines * m->n_f * 4 * sizeof *s->rows);
        s->quads = fftwf_malloc(GROUP * m->n_f * 8 * sizeof *s->quads);
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
    struct scratch *s = m->scratch;
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

static void free_scratch(struct scratch *s)
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

#define LANES 8
typedef float lanes __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

/* -- one trace's spectrum, its time origin in the middle of the trace -------------------
 */

struct migration { /* what the workers share */
    struct fk *fk;
    const float complex *gather;
    const float *weight;
    float *intensity;
};

/* Into the blocks of spectrum [block][iy][ix][BLOCK]. */
static void store_spectrum(const struct fk *m, const fftwf_complex *transform, size_t ix,
                           size_t iy)
{
    long n = (long)m->nt_fft;
    for (size_t q = 0; q < m->n_f; q++) {
        long from = ((m->first_bin + (long)q) % n + n) % n;
        float c = m->centring[2 * q], s = m->centring[2 * q + 1];
        size_t block = q / X_BLOCK * m->y.lines + iy;
        float *out = m->spectrum + (block * m->x.lines + ix) * BLOCK + q % X_BLOCK * 2;
        out[0] = transform[from][0] * c - transform[from][1] * s;
        out[1] = transform[from][0] * s + transform[from][1] * c;
    }
}

static void transform_line(void *ctx, size_t ix, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    fftwf_complex *buffer = m->scratch[thread].trace;
    for (size_t iy = 0; iy < m->y.lines; iy++) {
        if (ix < m->x_range[iy][0] || ix >= m->x_range[iy][1])
            continue;
        size_t cell = ix * m->y.lines + iy;
        const float *trace = (const float *)(g->gather + cell * m->trace.n_samples);
        memset(buffer, 0, m->nt_fft * sizeof *buffer);
        for (size_t n = 0; n < m->trace.n_samples; n++) {
            buffer[n][0] = g->weight[cell] * trace[2 * n];
            buffer[n][1] = g->weight[cell] * trace[2 * n + 1];
        }
        fftwf_execute_dft(m->time_plan, buffer, m->scratch[thread].trace_spectrum);
        store_spectrum(m, m->scratch[thread].trace_spectrum, ix, iy);
    }
}

/* -- sums over lines --------------------------------------------------------------------
 */

/* From the sums with cosine and sine, the waves exp(-i k b) and exp(+i k b), interleaved:
 * re im of one, re im of the other, for each value in turn. */
VECTOR_INLINE void split(const lanes *cosine, const lanes *sine, lanes *out)
{
    lanes c = *cosine, d = *sine;
    lanes turned = __builtin_shufflevector(d, d, 1, 0, 3, 2, 5, 4, 7, 6) *
                   (lanes){1, -1, 1, -1, 1, -1, 1, -1};
    lanes plus = c + turned, minus = c - turned;
    out[0] = __builtin_shufflevector(plus, minus, 0, 1, 8, 9, 2, 3, 10, 11);
    out[1] = __builtin_shufflevector(plus, minus, 4, 5, 12, 13, 6, 7, 14, 15);
}

/* The waves of one block, lines [n_lines][BLOCK], at +-k: out[2 BLOCK].  All sums
 * stay in registers. */
VECTOR_INLINE void sum_block(const float *block, size_t n_lines, const float *cosine,
                             const float *sine, lanes *out)
{
    lanes c0 = {0}, c1 = {0}, c2 = {0}, c3 = {0}, s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0};
    for (size_t b = 0; b < n_lines; b++) {
        const lanes *x = (const lanes *)(block + b * BLOCK);
        c0 += cosine[b] * x[0];
        c1 += cosine[b] * x[1];
        c2 += cosine[b] * x[2];
        c3 += cosine[b] * x[3];
        s0 += sine[b] * x[0];
        s1 += sine[b] * x[1];
        s2 += sine[b] * x[2];
        s3 += sine[b] * x[3];
    }
    split(&c0, &s0, out);
    split(&c1, &s1, out + 2);
    split(&c2, &s2, out + 4);
    split(&c3, &s3, out + 6);
}

/* rows [n_kx][n_f / 8][y lines][BLOCK]: the sums over x for +kx and -kx, frequency by
 * frequency, of several kx while a block is in the cache. */
VECTOR_CLONES
static void sum_over_x(const struct fk *m, const struct wave *waves, size_t n_kx,
                       struct scratch *s)
{
    size_t n_blocks = m->n_f / X_BLOCK, one = m->y.lines * BLOCK;
    for (size_t k = 0; k < n_blocks; k++) {
        for (size_t iy = 0; iy < m->y.lines; iy++) {
            size_t first = m->x_range[iy][0], n = m->x_range[iy][1] - first;
            const float *block = m->spectrum +
                                 ((k * m->y.lines + iy) * m->x.lines + first) * BLOCK;
            for (size_t w = 0; w < n_kx; w++) {
                lanes sums[2 * BLOCK / LANES];
                size_t at = waves[w].kx * m->x.lines + first;
                if (k < waves[w].first_bin / X_BLOCK)
                    continue;
                sum_block(block, n, m->x.cosine + at, m->x.sine + at, sums);
                float *row = s->rows + 2 * (w * n_blocks + k) * one + iy * BLOCK;
                memcpy(row, sums, BLOCK * sizeof *row);
                memcpy(row + one, sums + BLOCK / LANES, BLOCK * sizeof *row);
            }
        }
    }
}

/* quads [GROUP][n_f][8]: the plane waves (+kx +ky) (+kx -ky) (-kx +ky) (-kx -ky) of
 * n_ky wavenumbers from ky on. */
VECTOR_CLONES
static void sum_over_y(const struct fk *m, const float *rows, size_t ky, size_t n_ky,
                       size_t q_low, struct scratch *s)
{
    for (size_t k = q_low / Y_BLOCK; k < m->n_f / Y_BLOCK; k++)
        for (size_t g = 0; g < n_ky; g++)
            sum_block(rows + k * m->y.lines * BLOCK, m->y.lines,
                      m->y.cosine + (ky + g) * m->y.lines,
                      m->y.sine + (ky + g) * m->y.lines,
                      (lanes *)(s->quads + (g * m->n_f + k * Y_BLOCK) * 8));
}

/* -- Stolt's map ------------------------------------------------------------------------
 */

struct column {    /* where the four plane waves of a quad go: rows of the two planes */
    float *row[4]; /* NULL: a wave that another of the four already is */
};

static double lowest_frequency(const struct fk *m, double k_lateral)
{
    return m->c * k_lateral / (4.0 * M_PI * m->sine_max);
}

/* First spectrum bin that a lateral wavenumber needs. */
static size_t lowest_bin(const struct fk *m, double k_lateral)
{
    double at = (lowest_frequency(m, k_lateral) - m->f0_hz) / m->df_hz - TAPS;
    return at > 0.0 ? (size_t)fmin(at, (double)(m->n_f - 1)) : 0;
}

/* Depth wavenumber, as an index from kz_first, of a frequency; 0 where it is evanescent.
 */
static double depth_index(const struct fk *m, double f_hz, double k_lateral2)
{
    double k = 4.0 * M_PI * f_hz / m->c;
    double kz = sqrt(fmax(k * k - k_lateral2, 0.0));
    return fmax(kz / m->dkz - (double)m->kz_first, 0.0);
}

/* For depth wavenumbers low..high-1: the spectrum bin before, the weights between bins,
 * and the phase that puts the grid's first plane at 0, with the gain. */
VECTOR_CLONES
static void plan_map(const struct fk *m, double k_lateral2, size_t low, size_t high,
                     struct scratch *s)
{
    double f_scale = m->c / (4.0 * M_PI), depth_turns = m->depth_m / (2.0 * M_PI);
    double per_hz = 1.0 / m->df_hz, highest = (double)(m->n_f - TAPS / 2 - 1);
    for (size_t z = low; z < high; z++) {
        double kz = (double)(m->kz_first + (long)z) * m->dkz;
        double f = f_scale * sqrt(k_lateral2 + kz * kz);
        double at = (f - m->f0_hz) * per_hz;
        at = at < TAPS / 2 - 1 ? TAPS / 2 - 1 : at;
        at = at > highest ? highest : at;
        int below = (int)at;
        s->bin[z] = below - (TAPS / 2 - 1);
        /* Downwards: to read all frequencies half a step too low turns each echo by what
         * is the same over the whole image but for 3 mrad from one end of the trace to
         * the other, and of the image the magnitude is left. */
        s->fraction[z] = (int)((at - below) * FRACTIONS);
        double turns = kz * depth_turns - f * m->centre_s;
        float gain = m->gain[z], re, im;
        phasor((float)(turns - rint(turns)), &re, &im);
        s->phase_re[z] = gain * re;
        s->phase_im[z] = gain * im;
    }
}

static inline void add_wave(float *row, size_t z, float re, float im)
{
    row[2 * z] += re;
    row[2 * z + 1] += im;
}

/* Adds the map of quads onto depth wavenumbers.  Quads hold four plane waves side by
 * side, as re, im pairs: LANES floats. */
VECTOR_CLONES
static void map_quad(const struct fk *m, const float *quads, size_t low, size_t high,
                     const struct scratch *s, const struct column *to)
{
    for (size_t z = low; z < high; z++) {
        const float *w = m->weights + (size_t)s->fraction[z] * TAPS;
        const lanes *x = (const lanes *)(quads + 8 * (size_t)s->bin[z]);
        lanes sum = w[0] * x[0];
        for (int q = 1; q < TAPS; q++)
            sum += w[q] * x[q];
        float c = s->phase_re[z], d = s->phase_im[z];
        lanes turned = __builtin_shufflevector(sum, sum, 1, 0, 3, 2, 5, 4, 7, 6);
        lanes y = sum * c + turned * (lanes){-d, d, -d, d, -d, d, -d, d};
        add_wave(to->row[0], z, y[0], y[1]);
        if (to->row[1])
            add_wave(to->row[1], z, y[2], y[3]);
        if (to->row[2])
            add_wave(to->row[2], z, y[4], y[5]);
        if (to->row[3])
            add_wave(to->row[3], z, y[6], y[7]);
    }
}

/* One quad: which depth wavenumbers its frequencies reach, and their map. */
static void migrate_quad(const struct fk *m, double k_lateral2, const float *quads,
                         struct scratch *s, const struct column *to)
{
    double f_low =
        fmax(lowest_frequency(m, sqrt(k_lateral2)), m->f0_hz + (TAPS / 2 - 1) * m->df_hz);
    double f_high = m->f0_hz + (double)(m->n_f - TAPS / 2 - 1) * m->df_hz;
    size_t low = (size_t)ceil(depth_index(m, f_low, k_lateral2));
    size_t high = (size_t)floor(depth_index(m, f_high, k_lateral2)) + 1;
    if (high > m->n_kz)
        high = m->n_kz;
    if (low >= high)
        return;
    plan_map(m, k_lateral2, low, high, s);
    map_quad(m, quads, low, high, s, to);
}

/* The rows of the two planes that hold folded wavenumbers +-(kx, ky). */
static struct column find_rows(const struct fk *m, size_t kx, size_t ky, size_t fold,
                               const struct scratch *s)
{
    size_t plus = kx % m->x.n == fold ? 0 : 1;
    size_t minus = fold == (m->x.n - fold) % m->x.n ? plus : 1 - plus;
    size_t up = ky % m->y.n, down = (m->y.n - up) % m->y.n;
    fftwf_complex *p = s->plane + plus * m->y.n * m->n_kz;
    fftwf_complex *q = s->plane + minus * m->y.n * m->n_kz;
    struct column to = {{(float *)(p + up * m->n_kz), (float *)(p + down * m->n_kz),
                         (float *)(q + up * m->n_kz), (float *)(q + down * m->n_kz)}};
    if (ky == 0)
        to.row[1] = to.row[3] = NULL;
    if (kx == 0)
        to.row[2] = to.row[3] = NULL;
    return to;
}

/* All plane waves of +-kx into the planes, from rows [n_f / 8][y lines][BLOCK]. */
static void map_row(struct fk *m, struct wave wave, const float *rows, struct scratch *s)
{
    double limit = 4.0 * M_PI * (m->f0_hz + (double)m->n_f * m->df_hz) / m->c *
                   m->sine_max;
    double x2 = (double)wave.kx * m->x.dk * (double)wave.kx * m->x.dk;
    double y_limit = sqrt(fmax(limit * limit - x2, 0.0)) / m->y.dk;
    size_t n_ky = (size_t)fmin(floor(y_limit), (double)m->y.k_max) + 1;
    for (size_t ky = 0; ky < n_ky; ky += GROUP) {
        size_t n = n_ky - ky < GROUP ? n_ky - ky : GROUP;
        double y = (double)ky * m->y.dk;
        sum_over_y(m, rows, ky, n, lowest_bin(m, sqrt(x2 + y * y)), s);
        for (size_t g = 0; g < n; g++) {
            struct column to = find_rows(m, wave.kx, ky + g, wave.fold, s);
            y = (double)(ky + g) * m->y.dk;
            migrate_quad(m, x2 + y * y, s->quads + g * m->n_f * 8, s, &to);
        }
    }
}

/* -- back to space ----------------------------------------------------------------------
 */

/* The wavenumbers of half: those from 0 up, then those from below 0. */
static size_t upward(const struct fk *m)
{
    return m->x.kept < m->x.n ? m->x.k_max + 1 : m->x.n;
}

/* One plane of folded kx: over ky, then over kz, into half. */
static void plane_to_space(struct fk *m, fftwf_complex *plane, size_t kx,
                           struct scratch *s)
{
    const size_t *n = m->grid.n;
    size_t row = kx < upward(m) ? kx : kx + m->x.kept - m->x.n;
    fftwf_execute_dft(m->y_plan, plane, s->plane_image);
    for (size_t y = 0; y < n[1]; y++) {
        memset(s->column, 0, m->nz_fft * sizeof *s->column);
        size_t at = (size_t)m->kz_first % m->nz_fft;
        for (size_t z = 0; z < m->n_kz; z++) {
            s->column[at][0] += s->plane_image[y * m->n_kz + z][0];
            s->column[at][1] += s->plane_image[y * m->n_kz + z][1];
            at = at + 1 == m->nz_fft ? 0 : at + 1;
        }
        fftwf_execute_dft(m->z_plan, s->column, s->column_image);
        memcpy(m->half + (row * n[1] + y) * n[2], s->column_image,
               n[2] * sizeof *s->column_image);
    }
}

/* The wavenumbers that fold onto +-first, then those of the next fold; returns how many.
 */
static size_t list_waves(const struct fk *m, size_t first, size_t end, struct wave *out)
{
    size_t n = 0;
    for (size_t fold = first; fold < end; fold++)
        for (size_t kx = 0; kx <= m->x.k_max; kx++)
            if (kx % m->x.n == fold || kx % m->x.n == (m->x.n - fold) % m->x.n)
                out[n++] = (struct wave){kx, fold, lowest_bin(m, (double)kx * m->x.dk)};
    return n;
}

/* The planes of +-fold over y and z. */
static void fold_to_space(struct fk *m, size_t fold, struct scratch *s)
{
    size_t mirrored = (m->x.n - fold) % m->x.n;
    plane_to_space(m, s->plane, fold, s);
    if (mirrored != fold)
        plane_to_space(m, s->plane + m->y.n * m->n_kz, mirrored, s);
}

/* All wavenumbers of a group of folds, and their transform over y and z. */
static void image_folds(void *ctx, size_t group, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    struct scratch *s = &m->scratch[thread];
    size_t first = group * m->folds, last = m->x.kept / 2 + 1;
    const struct wave *w = s->waves;
    size_t n =
        list_waves(m, first, last - first < m->folds ? last : first + m->folds, s->waves);
    for (size_t i = 0; i < n; i++) {
        if (i % GROUP == 0)
            sum_over_x(m, w + i, n - i < GROUP ? n - i : GROUP, s);
        if (i == 0 || w[i].fold != w[i - 1].fold)
            memset(s->plane, 0, 2 * m->y.n * m->n_kz * sizeof *s->plane);
        map_row(m, w[i], s->rows + i % GROUP * m->n_f * m->y.lines * 4, s);
        if (i + 1 == n || w[i].fold != w[i + 1].fold)
            fold_to_space(m, w[i].fold, s);
    }
}

/* line [grid nz][x.n] from rows first..end-1 of half: whole cache lines are written, and
 * rows are read along. */
static void gather_row(const struct fk *m, size_t y, size_t first, size_t end,
                       fftwf_complex *line)
{
    const size_t *n = m->grid.n;
    for (size_t kx = first; kx < end; kx += LANES) {
        size_t width = end - kx < LANES ? end - kx : LANES;
        const fftwf_complex *from = m->half + (kx * n[1] + y) * n[2];
        for (size_t z = 0; z < n[2]; z++)
            for (size_t l = 0; l < width; l++)
                memcpy(line[z * m->x.n + kx + l], from[l * n[1] * n[2] + z],
                       sizeof *line);
    }
}

static void image_row(void *ctx, size_t y, size_t thread)
{
    struct migration *g = ctx;
    struct fk *m = g->fk;
    const size_t *n = m->grid.n;
    struct scratch *s = &m->scratch[thread];
    gather_row(m, y, 0, upward(m), s->line);
    gather_row(m, y, upward(m), m->x.kept, s->line + (m->x.n - m->x.kept));
    for (size_t z = 0; z < n[2]; z++) {
        fftwf_execute_dft(m->x_plan, s->line + z * m->x.n, s->line_image);
        float *to = g->intensity + (z * n[1] + y) * n[0];
        for (size_t x = 0; x < n[0]; x++) {
            float re = m->scale * s->line_image[x][0],
                  im = m->scale * s->line_image[x][1];
            to[x] = re * re + im * im;
        }
    }
}

double fk_plane_waves(const struct fk *m)
{
    return (double)(m->x.k_max + 1) * (double)(m->y.k_max + 1) * (double)m->n_kz;
}

void fk_migrate(struct fk *m, const float complex *gather, const float *weight,
                float *intensity)
{
    struct migration g = {m, gather, weight, intensity};
    pool_run(m->pool, m->x.lines, transform_line, &g);
    pool_run(m->pool, (m->x.kept / 2 + m->folds) / m->folds, image_folds, &g);
    pool_run(m->pool, m->grid.n[1], image_row, &g);
}
