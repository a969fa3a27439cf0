/* recon/inverse/sparse_operator_plan.c -- what the coherent operator allocates and keeps:
 * tables of the pulse, and the traces. */
#include "recon/inverse/sparse_operator_plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/fold.h"
#include "recon/hann.h"

void sparse_operator_destroy(struct sparse_operator *s)
{
    if (!s)
        return;
    float *const all[] = {s->pulse, s->traces, s->weight, s->delay, s->re,
                          s->im,    s->scale,  s->x_re,   s->x_im,  s->autocorrelation};
    for (size_t a = 0; a < sizeof all / sizeof *all; a++)
        free(all[a]);
    for (size_t r = 0; r < SPARSE_RUNS; r++) {
        free(s->runs[r].sum_re);
        free(s->runs[r].sum_im);
        free(s->runs[r].window);
    }
    free(s->live);
    free(s->cell);
    free(s->fold);
    geometry_clear(&s->geometry);
    free(s);
}

static double sinc(double x)
{
    return fabs(x) < 1e-9 ? 1.0 : sin(M_PI * x) / (M_PI * x);
}

/* Of the Hann pulse, whose spectrum is cos^2: cos^4 in powers of exp(2 pi i f). */
static double hann_autocorrelation(double x)
{
    return sinc(x) + (sinc(x - 1.0) + sinc(x + 1.0)) * 2.0 / 3.0 +
           (sinc(x - 2.0) + sinc(x + 2.0)) / 6.0;
}

/* per_sample: samples in units of 1 / band. */
static void fill_tables(struct sparse_operator *s, double per_sample)
{
    for (size_t f = 0; f <= SPARSE_FRACTIONS; f++) {
        for (size_t k = 0; k < 2 * s->half; k++) {
            double at = (double)k - (double)(s->half - 1) - (double)f / SPARSE_FRACTIONS;
            s->pulse[f * 2 * s->half + k] = (float)hann_pulse(at * per_sample);
        }
    }
    for (size_t q = 0; q < s->n_lags; q++)
        s->autocorrelation[q] =
            (float)hann_autocorrelation((double)q / SPARSE_LAGS * per_sample);
}

static int allocate(struct sparse_operator *s)
{
    size_t taps = 2 * s->half, points = s->max_points;
    size_t table = s->geometry.n_positions * sparse_elements(s) * points;
    struct {
        float **at;
        size_t n;
    } all[] = {{&s->pulse, (SPARSE_FRACTIONS + 1) * taps},
               {&s->traces, 2 * s->n_traces * s->format.n_samples},
               {&s->weight, s->n_traces},
               {&s->delay, table},
               {&s->re, table},
               {&s->im, table},
               {&s->autocorrelation, s->n_lags},
               {&s->scale, points},
               {&s->x_re, points},
               {&s->x_im, points}};
    int err = 0;
    for (size_t a = 0; a < sizeof all / sizeof *all; a++)
        if (!(*all[a].at = calloc(all[a].n, sizeof(float))))
            err = -ENOMEM;
    for (size_t r = 0; r < SPARSE_RUNS; r++) {
        struct sparse_run *run = &s->runs[r];
        run->sum_re = malloc(points * sizeof(float));
        run->sum_im = malloc(points * sizeof(float));
        /* also three rows of points, for the Gram matrix */
        size_t window = 2 * sparse_window(s);
        run->window = calloc(window > 3 * points ? window : 3 * points, sizeof(float));
        if (!run->sum_re || !run->sum_im || !run->window)
            err = -ENOMEM;
    }
    s->live = calloc(s->n_traces, sizeof *s->live);
    s->cell = calloc(s->n_traces, sizeof *s->cell);
    s->fold = calloc(s->n_traces, sizeof *s->fold);
    return s->live && s->cell && s->fold ? err : -ENOMEM;
}

int sparse_operator_create(struct sparse_operator **out, const struct imager_config *cfg,
                           size_t max_points)
{
    struct sparse_operator *s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    double band_hz = cfg->band_hz[1] - cfg->band_hz[0];
    s->format = cfg->format;
    s->pool = cfg->pool;
    s->max_points = max_points;
    s->half =
        (size_t)fmin(ceil(SPARSE_REACH * s->format.rate_hz / band_hz), SPARSE_MAX_HALF);
    s->n_lags = (size_t)ceil(SPARSE_REACH * s->format.rate_hz / band_hz * SPARSE_LAGS);
    int err = geometry_copy(&s->geometry, cfg->geometry);
    if (!err) {
        s->pairs = s->geometry.n_speakers * s->geometry.n_microphones;
        s->n_traces = s->pairs * s->geometry.n_positions;
        err = allocate(s);
    }
    if (!err)
        err = fold_number(&s->geometry, s->cell, &s->n_cells);
    if (err) {
        sparse_operator_destroy(s);
        return err;
    }
    fill_tables(s, band_hz / s->format.rate_hz);
    *out = s;
    return 0;
}

void sparse_operator_add(struct sparse_operator *s, size_t position, size_t speaker,
                         const float complex *traces, const bool *masked)
{
    size_t n_m = s->geometry.n_microphones, n = s->format.n_samples;
    size_t first = position * s->pairs + speaker * n_m;
    for (size_t i = 0; i < n_m; i++) {
        if (masked && masked[i])
            continue;
        memcpy(s->traces + 2 * (first + i) * n, traces + i * n, n * sizeof *traces);
        s->live[first + i] = true;
    }
}

void sparse_operator_reset(struct sparse_operator *s)
{
    memset(s->live, 0, s->n_traces * sizeof *s->live);
}
