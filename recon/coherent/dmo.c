/* SPDX-License-Identifier: MIT */
#include "recon/coherent/dmo.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

#define ROWS 8 /* lines of midpoints that are summed together */

struct dmo {
    size_t n_lines, n_offsets, n_inputs;
    size_t span;     /* shifts in the table: from -(n_lines - 1) up, whole ROWS beyond */
    uint32_t *first; /* [n_inputs]: table entry of line 0 */
    float *kernel;   /* [bin][n_offsets][span][re, im] */
};

/* W s, s = A - 1, and W ln(1 + s / 2) with nothing subtracted that is nearly equal: s is
 * x / (1 + sqrt(1 + x)), x = (2 k h / W)^2, multiplied by W so that W may be 0. */
double dmo_phase(double kh, double w)
{
    double q = fabs(kh), p = fabs(w);
    if (q == 0.0 || isinf(p))
        return 0.0;
    double ws = 4.0 * q * (q / (p + hypot(p, 2.0 * q)));
    double half = 0.5 * ws / p; /* 0 / 0 and beyond the largest number at p = 0 */
    double log_part = half < 1e300 ? p * log1p(half) : 0.0;
    return copysign(0.5 * (ws - log_part), w);
}

/* -- tables -----------------------------------------------------------------------------
 */

struct tables { /* while they are made */
    const struct dmo_config *cfg;
    struct dmo *dmo;
    size_t period;  /* of the sum over wavenumbers, in lines; even */
    double *cosine; /* [n_lines][period / 2 + 1]: weighted */
    double *phasor; /* [threads][2][period / 2 + 1] */
};

/* The convolution of one bin and offset: the sum of exp(i (k d - phi)) over the
 * wavenumbers up to what the lines sample, even in d. */
static void make_kernel(const struct tables *t, double w, double half_offset_m,
                        double *phasor, float *kernel)
{
    const struct dmo_config *cfg = t->cfg;
    size_t n_k = t->period / 2 + 1;
    for (size_t m = 0; m < n_k; m++) {
        double k = 2.0 * M_PI * (double)m / ((double)t->period * cfg->pitch_m);
        double phi = dmo_phase(k * half_offset_m, w);
        phasor[m] = cos(phi);
        phasor[n_k + m] = w == 0.0 ? 0.0 : -sin(phi);
    }
    for (size_t d = 0; d < cfg->n_lines; d++) {
        const double *c = t->cosine + d * n_k;
        double re = 0.0, im = 0.0;
        for (size_t m = 0; m < n_k; m++) {
            re += c[m] * phasor[m];
            im += c[m] * phasor[n_k + m];
        }
        float *right = kernel + 2 * (cfg->n_lines - 1 + d);
        float *left = kernel + 2 * (cfg->n_lines - 1 - d);
        right[0] = left[0] = (float)re;
        right[1] = left[1] = (float)im;
    }
}

static void make_bin(void *ctx, size_t bin, size_t thread)
{
    struct tables *t = ctx;
    struct dmo *d = t->dmo;
    double *phasor = t->phasor + thread * (t->period + 2);
    for (size_t o = 0; o < d->n_offsets; o++)
        make_kernel(t, t->cfg->w[bin], t->cfg->half_offset_m[o], phasor,
                    d->kernel + (bin * d->n_offsets + o) * d->span * 2);
}

static int make_tables(struct dmo *d, const struct dmo_config *cfg)
{
    double longest_m = 0.0;
    for (size_t o = 0; o < cfg->n_offsets; o++)
        longest_m = fmax(longest_m, cfg->half_offset_m[o]);
    /* Copies of the convolution, one period apart, stay clear of each other. */
    size_t reach = (size_t)ceil(longest_m / cfg->pitch_m);
    struct tables t = {cfg, d, 2 * (cfg->n_lines + reach + 1), NULL, NULL};
    size_t n_k = t.period / 2 + 1;
    t.cosine = malloc(cfg->n_lines * n_k * sizeof *t.cosine);
    t.phasor = malloc(pool_threads(cfg->pool) * 2 * n_k * sizeof *t.phasor);
    int err = t.cosine && t.phasor ? 0 : -ENOMEM;
    for (size_t q = 0; !err && q < cfg->n_lines * n_k; q++) {
        size_t m = q % n_k, turn = q / n_k * m % t.period;
        double once = m == 0 || m == n_k - 1 ? 1.0 : 2.0;
        t.cosine[q] = once / (double)t.period *
                      cos(2.0 * M_PI * (double)turn / (double)t.period);
    }
    if (!err)
        pool_run(cfg->pool, cfg->n_bins, make_bin, &t);
    free(t.cosine);
    free(t.phasor);
    return err;
}

static bool sensible(const struct dmo_config *cfg)
{
    bool ok = cfg->n_lines && cfg->n_offsets && cfg->n_inputs && cfg->n_bins &&
              cfg->pitch_m > 0.0 && isfinite(cfg->pitch_m);
    for (size_t o = 0; ok && o < cfg->n_offsets; o++)
        ok = cfg->half_offset_m[o] >= 0.0 && isfinite(cfg->half_offset_m[o]);
    for (size_t q = 0; ok && q < cfg->n_inputs; q++)
        ok = cfg->offset[q] < cfg->n_offsets && cfg->line[q] < cfg->n_lines;
    return ok;
}

int dmo_create(struct dmo **out, const struct dmo_config *cfg)
{
    if (!sensible(cfg))
        return -EINVAL;
    struct dmo *d = calloc(1, sizeof *d);
    if (!d)
        return -ENOMEM;
    d->n_lines = cfg->n_lines;
    d->n_offsets = cfg->n_offsets;
    d->n_inputs = cfg->n_inputs;
    d->span = 2 * cfg->n_lines - 1 + ROWS - 1;
    d->first = malloc(cfg->n_inputs * sizeof *d->first);
    d->kernel = calloc(cfg->n_bins * cfg->n_offsets * d->span, 2 * sizeof *d->kernel);
    int err = d->first && d->kernel ? make_tables(d, cfg) : -ENOMEM;
    if (err) {
        dmo_destroy(d);
        return err;
    }
    for (size_t q = 0; q < cfg->n_inputs; q++)
        d->first[q] =
            (uint32_t)(cfg->offset[q] * d->span + cfg->n_lines - 1 - cfg->line[q]);
    *out = d;
    return 0;
}

void dmo_destroy(struct dmo *d)
{
    if (!d)
        return;
    free(d->first);
    free(d->kernel);
    free(d);
}

/* -- stack ------------------------------------------------------------------------------
 */

/* ROWS lines.  fetch: the next bin's inputs and kernel, whose order no machine foresees:
 * each input is in a page of its own. */
VECTOR_INLINE void stack_rows(const struct dmo *d, const float *kernel, const float *in,
                              size_t in_stride, float *out, size_t out_stride,
                              size_t n_rows, bool fetch)
{
    float re[ROWS][VECTOR_LANES] = {{0}}, im[ROWS][VECTOR_LANES] = {{0}};
    for (size_t q = 0; q < d->n_inputs; q++) {
        const float *k = kernel + 2 * (size_t)d->first[q], *x = in + q * in_stride;
        const float *xr = x, *xi = x + VECTOR_LANES;
        if (fetch) {
            __builtin_prefetch(x + 2 * VECTOR_LANES);
            __builtin_prefetch(x + 3 * VECTOR_LANES);
            __builtin_prefetch(k + d->n_offsets * d->span * 2);
        }
#pragma GCC unroll 8 /* all ROWS: their sums become registers */
        for (size_t r = 0; r < ROWS; r++) {
            for (size_t v = 0; v < VECTOR_LANES; v++) {
                re[r][v] += k[2 * r] * xr[v];
                im[r][v] += k[2 * r] * xi[v];
                re[r][v] -= k[2 * r + 1] * xi[v];
                im[r][v] += k[2 * r + 1] * xr[v];
            }
        }
    }
    for (size_t r = 0; r < n_rows; r++) {
        memcpy(out + r * out_stride, re[r], sizeof re[r]);
        memcpy(out + r * out_stride + VECTOR_LANES, im[r], sizeof im[r]);
    }
}

VECTOR_CLONES
void dmo_stack(const struct dmo *d, size_t bin, const float *restrict in,
               size_t in_stride, float *restrict out, size_t out_stride)
{
    const float *kernel = d->kernel + bin * d->n_offsets * d->span * 2;
    for (size_t line = 0; line < d->n_lines; line += ROWS) {
        size_t n_rows = d->n_lines - line < ROWS ? d->n_lines - line : ROWS;
        stack_rows(d, kernel + 2 * line, in, in_stride, out + line * out_stride,
                   out_stride, n_rows, line == 0);
    }
}
