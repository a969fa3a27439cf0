/* recon/power/incoherent.c -- keeps the traces' powers, filters and weighs them; see
 * incoherent.h. */
#include "recon/power/incoherent.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/method.h"

#define FINE       INCOHERENT_FINE
#define FADE       16 /* samples over which the ends of a trace fade */
#define LANE_BLOCK 16
#define LOUDEST    1e26f /* power; louder is no echo, and no number when summed */
#define REACH      4.0   /* of the filter, in standard deviations */

/* Of the filter, in path.  Measured: 5 mm is sharper where positions are right, 15 mm is
 * no better where they are wrong by 10 mm. */
#define SIGMA_M 0.008

static size_t n_traces(const struct incoherent *b)
{
    return incoherent_pairs(b) * b->geometry.n_positions;
}

/* -- create -----------------------------------------------------------------------------
 */

static void incoherent_destroy(void *state)
{
    struct incoherent *b = state;
    if (!b)
        return;
    if (b->scan)
        incoherent_scan_destroy(b);
    else
        incoherent_any_destroy(b);
    incoherent_slabs_destroy(b);
    for (size_t t = 0; b->scratch && t < pool_threads(b->pool); t++)
        free(b->scratch[t]);
    free(b->scratch);
    free(b->gain);
    free(b->filter);
    free(b->power);
    free(b->live);
    free(b->cell);
    free(b->fold);
    free(b->stored);
    incoherent_mirror_destroy(b->mirror);
    geometry_clear(&b->geometry);
    free(b);
}

static double smooth(double x) /* 0 to 1 */
{
    return x <= 0.0 ? 0.0 : x >= 1.0 ? 1.0 : 0.5 - 0.5 * cos(M_PI * x);
}

static int plan_gain(struct incoherent *b, double near_m)
{
    size_t n = b->in.n_samples;
    double c = b->geometry.sound_speed_m_s;
    double first = (2.0 * near_m / c - b->in.t0_s) * b->in.rate_hz;
    b->first = first > 0.0 ? (size_t)ceil(fmin(first, (double)n)) : 0;
    b->gain = malloc(n * sizeof *b->gain);
    if (!b->gain)
        return -ENOMEM;
    for (size_t q = 0; q < n; q++) {
        double range_m = 0.5 * c * (b->in.t0_s + (double)q / b->in.rate_hz);
        double edge = fmin((double)q - (double)b->first, (double)(n - 1 - q)) + 1.0;
        b->gain[q] = (float)(range_m * range_m * smooth(edge / (FADE + 1)));
    }
    return 0;
}

/* The negative second derivative of a Gaussian between samples, of no mean: what is even
 * over time is no echo. */
static int plan_filter(struct incoherent *b, double sigma)
{
    size_t half = (size_t)ceil(REACH * sigma);
    b->n_taps = 2 * half + 1;
    b->filter = malloc(FINE * b->n_taps * sizeof *b->filter);
    if (!b->filter)
        return -ENOMEM;
    for (size_t f = 0; f < FINE; f++) {
        double sum = 0.0, gauss = 0.0;
        for (int pass = 0; pass < 2; pass++) {
            for (size_t l = 0; l < b->n_taps; l++) {
                double x = ((double)l - (double)half - (double)f / FINE) / sigma;
                double g = exp(-0.5 * x * x), w = (1.0 - x * x) * g;
                if (pass == 0) {
                    sum += w;
                    gauss += g;
                } else {
                    b->filter[f * b->n_taps + l] = (float)((w - sum / gauss * g) / sigma);
                }
            }
        }
    }
    return 0;
}

static int allocate(struct incoherent *b)
{
    size_t n = n_traces(b), samples = b->in.n_samples + b->n_taps;
    b->n_groups = b->scan ? incoherent_pairs(b) : n;
    b->n_stored = b->in.n_samples * FINE + 3;
    b->power = calloc(n * b->in.n_samples, sizeof *b->power);
    b->live = calloc(n, sizeof *b->live);
    b->cell = malloc(n * sizeof *b->cell);
    b->stored = calloc(b->n_groups * b->n_stored, b->lanes * sizeof *b->stored);
    b->scratch = calloc(pool_threads(b->pool), sizeof *b->scratch);
    if (!b->power || !b->live || !b->cell || !b->stored || !b->scratch)
        return -ENOMEM;
    for (size_t t = 0; t < pool_threads(b->pool); t++)
        if (!(b->scratch[t] = calloc(samples * b->lanes, sizeof **b->scratch)))
            return -ENOMEM;
    int err = fold_number(&b->geometry, b->cell, &b->n_cells);
    if (err)
        return err;
    b->fold = malloc(b->n_cells * sizeof *b->fold);
    if (!b->fold)
        return -ENOMEM;
    return b->scan ? incoherent_scan_create(b) : incoherent_any_create(b);
}

static int incoherent_create(void **state, const struct imager_config *cfg,
                             const char **why)
{
    (void)why;
    struct incoherent *b = calloc(1, sizeof *b);
    if (!b)
        return -ENOMEM;
    b->in = cfg->format;
    b->grid = cfg->grid;
    b->pool = cfg->pool;
    int err = geometry_copy(&b->geometry, cfg->geometry);
    if (!err)
        err = plan_gain(b, cfg->gate_m[0]);
    if (!err) {
        double samples_per_m = b->in.rate_hz / cfg->geometry->sound_speed_m_s;
        err = plan_filter(b, SIGMA_M * samples_per_m);
    }
    if (!err)
        err = incoherent_slabs_create(b);
    if (!err) {
        b->scan = true;
        for (size_t i = 0; i < b->n_slabs; i++)
            b->scan = incoherent_scan_fits(b, &b->slabs[i]) && b->scan;
        b->lanes = b->scan ? (b->geometry.n_positions + LANE_BLOCK - 1) / LANE_BLOCK *
                                 LANE_BLOCK
                           : 1;
        err = allocate(b);
    }
    if (!err)
        err = incoherent_mirror_create(&b->mirror, cfg);
    if (err) {
        incoherent_destroy(b);
        return err;
    }
    *state = b;
    return 0;
}

/* -- add --------------------------------------------------------------------------------
 */

static void incoherent_add(void *state, size_t position, size_t speaker,
                           const float complex *traces, const bool *masked)
{
    struct incoherent *b = state;
    size_t n_m = b->geometry.n_microphones, n = b->in.n_samples;
    if (b->mirror)
        incoherent_mirror_add(b->mirror, position, speaker, traces, masked);
    for (size_t i = 0; i < n_m; i++) {
        if (masked && masked[i])
            continue;
        size_t t = position * incoherent_pairs(b) + speaker * n_m + i;
        const float *z = (const float *)(traces + i * n);
        float *p = b->power + t * n;
        for (size_t q = b->first; q < n; q++) {
            float power = z[2 * q] * z[2 * q] + z[2 * q + 1] * z[2 * q + 1];
            p[q] = power < LOUDEST ? b->gain[q] * power : 0.0f;
        }
        b->live[t] = true;
    }
}

static void incoherent_reset(void *state)
{
    struct incoherent *b = state;
    memset(b->power, 0, n_traces(b) * b->in.n_samples * sizeof *b->power);
    memset(b->live, 0, n_traces(b) * sizeof *b->live);
    if (b->mirror)
        incoherent_mirror_reset(b->mirror);
}

/* -- image ------------------------------------------------------------------------------
 */

static float weight(const struct incoherent *b, size_t trace)
{
    return b->live[trace] ? 1.0f / ((float)b->fold[b->cell[trace]] * (float)b->n_cells)
                          : 0.0f;
}

/* in [n + n_taps - 1][lanes], out [n][FINE][lanes]. */
VECTOR_CLONES
static void filter_lanes(const struct incoherent *b, size_t n, const float *restrict in,
                         float *restrict out)
{
    for (size_t q = 0; q < FINE * n; q++, out += b->lanes) {
        const float *w = b->filter + q % FINE * b->n_taps;
        const float *x = in + q / FINE * b->lanes;
        for (size_t k = 0; k < b->lanes; k += VECTOR_LANES) {
            float sum[VECTOR_LANES] = {0};
            for (size_t l = 0; l < b->n_taps; l++)
                for (size_t v = 0; v < VECTOR_LANES; v++)
                    sum[v] += w[l] * x[l * b->lanes + k + v];
            memcpy(out + k, sum, sizeof sum);
        }
    }
}

VECTOR_CLONES
static void filter_trace(const struct incoherent *b, size_t n, const float *restrict in,
                         float *restrict out)
{
    for (size_t f = 0; f < FINE; f++) {
        for (size_t q = 0; q < n; q++) {
            float sum = 0.0f;
            for (size_t l = 0; l < b->n_taps; l++)
                sum += b->filter[f * b->n_taps + l] * in[q + l];
            out[FINE * q + f] = sum;
        }
    }
}

/* Traces of a group side by side, weighed, after half a filter of zeros; then filtered.
 */
static void filter_group(void *ctx, size_t group, size_t thread)
{
    struct incoherent *b = ctx;
    size_t n = b->in.n_samples, pairs = incoherent_pairs(b);
    float *x = b->scratch[thread] + b->n_taps / 2 * b->lanes;
    size_t n_in_group = b->scan ? b->geometry.n_positions : 1;
    for (size_t k = 0; k < n_in_group; k++) {
        size_t trace = b->scan ? k * pairs + group : group;
        const float *p = b->power + trace * n;
        float w = weight(b, trace);
        for (size_t q = 0; q < n; q++)
            x[q * b->lanes + k] = w * p[q];
    }
    float *out = b->stored + (group * b->n_stored + 1) * b->lanes;
    if (b->scan)
        filter_lanes(b, n, b->scratch[thread], out);
    else
        filter_trace(b, n, b->scratch[thread], out);
}

/* A slab's voxels, finely spaced, where they are above 0. */
static void image_slab(struct incoherent *b, const struct incoherent_slab *slab,
                       float *intensity)
{
    b->slab = slab;
    b->image = slab->resample ? b->coarse : intensity;
    if (b->scan)
        incoherent_scan(b);
    else
        incoherent_any(b);
    if (slab->resample)
        resample_volume(slab->resample, b->coarse, intensity);
}

static void clip(void *ctx, size_t plane, size_t thread)
{
    struct incoherent *b = ctx;
    size_t n = b->grid.n[0] * b->grid.n[1];
    (void)thread;
    for (size_t v = plane * n; v < (plane + 1) * n; v++)
        b->image[v] = b->image[v] > 0.0f ? b->image[v] : 0.0f;
}

static void incoherent_image(void *state, float *intensity)
{
    struct incoherent *b = state;
    if (b->mirror && incoherent_mirror_image(b->mirror, intensity))
        return;
    memset(b->fold, 0, b->n_cells * sizeof *b->fold);
    for (size_t t = 0; t < n_traces(b); t++)
        b->fold[b->cell[t]] += b->live[t];
    pool_run(b->pool, b->n_groups, filter_group, b);
    for (size_t i = 0; i < b->n_slabs; i++)
        image_slab(b, &b->slabs[i],
                   intensity + b->slabs[i].first_plane * b->grid.n[0] * b->grid.n[1]);
    b->image = intensity;
    pool_run(b->pool, b->grid.n[2], clip, b);
}

const struct imager_method method_incoherent = {
    .name = "incoherent",
    .any_geometry = true,
    .create = incoherent_create,
    .add = incoherent_add,
    .image = incoherent_image,
    .reset = incoherent_reset,
    .destroy = incoherent_destroy,
};
