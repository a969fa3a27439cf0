/* recon/backprojection.c -- `--method backprojection`: each voxel sums every pair's trace
 * at its own two-way delay, phase kept, each pair weighted by 1 / (pairs that share its
 * midpoint).  Any geometry, near range too; slow. */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/method.h"
#include "recon/phasor.h"
#include "recon/sinc.h"

#define OVERSAMPLING                                                                     \
    4.4 /* stored rate over band width: linear interpolation to -41 dB                   \
         */
#define HALF_TAPS  4
#define TAPS       (2 * HALF_TAPS)
#define BLOCK_ROWS 12   /* rows of voxels that are summed together: their distances to */
#define SAME_M     1e-3 /* all elements of a position stay in the cache */

struct block {          /* scratch of a thread, for n_block voxels */
    float *position[3]; /* [n_block] */
    float *delay;       /* [elements][n_block] in stored samples */
    float *phasor_re;   /* [elements][n_block] of the carrier over that delay */
    float *phasor_im;
    float *part_re, *part_im; /* [n_block] of one speaker */
    float *sum_re, *sum_im;   /* [n_block] */
};

struct backprojection {
    struct geometry geometry;
    struct trace_format in;
    struct grid grid;
    struct pool *pool;
    size_t upsampling;
    size_t n_stored; /* samples of a stored trace; its first and last are 0 */
    double rate_hz;
    size_t muted;          /* stored samples before the gate */
    double *fine;          /* [upsampling][TAPS] */
    float complex *traces; /* [position][speaker][microphone][n_stored] */
    uint32_t *cell;        /* [position][speaker][microphone]: number of its midpoint */
    size_t n_cells;
    bool *live;     /* [position][speaker][microphone]: added, not masked */
    float *weight;  /* [position][speaker][microphone] 1 / live pairs of the midpoint */
    uint32_t *fold; /* [n_cells] */
    size_t n_block;
    struct block *blocks; /* [threads] */
    float *image;         /* where imager_image wants it */
};

static size_t n_pairs(const struct backprojection *b)
{
    return b->geometry.n_speakers * b->geometry.n_microphones;
}

static size_t n_traces(const struct backprojection *b)
{
    return n_pairs(b) * b->geometry.n_positions;
}

/* -- midpoints that several pairs share -------------------------------------------------
 */

struct middle {
    long at[3]; /* in units of SAME_M */
    uint32_t trace;
};

static int by_place(const void *a, const void *b)
{
    return memcmp(((const struct middle *)a)->at, ((const struct middle *)b)->at,
                  sizeof((const struct middle *)a)->at);
}

static int number_midpoints(struct backprojection *b)
{
    size_t n = n_traces(b);
    struct middle *middles = calloc(n, sizeof *middles);
    if (!middles)
        return -ENOMEM;
    for (size_t t = 0; t < n; t++) {
        double s[3], m[3];
        size_t k = t / n_pairs(b), pair = t % n_pairs(b);
        geometry_speaker(&b->geometry, k, pair / b->geometry.n_microphones, s);
        geometry_microphone(&b->geometry, k, pair % b->geometry.n_microphones, m);
        for (int a = 0; a < 3; a++)
            middles[t].at[a] = lrint(0.5 * (s[a] + m[a]) / SAME_M);
        middles[t].trace = (uint32_t)t;
    }
    qsort(middles, n, sizeof *middles, by_place);
    for (size_t t = 0; t < n; t++) {
        if (t == 0 || by_place(&middles[t - 1], &middles[t]) != 0)
            b->n_cells++;
        b->cell[middles[t].trace] = (uint32_t)(b->n_cells - 1);
    }
    free(middles);
    return 0;
}

/* -- create -----------------------------------------------------------------------------
 */

static void block_free(struct block *s)
{
    for (int a = 0; a < 3; a++)
        free(s->position[a]);
    free(s->delay);
    free(s->phasor_re);
    free(s->phasor_im);
    free(s->part_re);
    free(s->part_im);
    free(s->sum_re);
    free(s->sum_im);
}

static int block_allocate(struct block *s, size_t n, size_t elements)
{
    bool ok = true;
    for (int a = 0; a < 3; a++)
        ok = (s->position[a] = malloc(n * sizeof(float))) && ok;
    ok = (s->delay = malloc(elements * n * sizeof(float))) && ok;
    ok = (s->phasor_re = malloc(elements * n * sizeof(float))) && ok;
    ok = (s->phasor_im = malloc(elements * n * sizeof(float))) && ok;
    ok = (s->part_re = malloc(n * sizeof(float))) && ok;
    ok = (s->part_im = malloc(n * sizeof(float))) && ok;
    ok = (s->sum_re = malloc(n * sizeof(float))) && ok;
    ok = (s->sum_im = malloc(n * sizeof(float))) && ok;
    return ok ? 0 : -ENOMEM;
}

static void backprojection_destroy(void *state)
{
    struct backprojection *b = state;
    if (!b)
        return;
    for (size_t t = 0; b->blocks && t < pool_threads(b->pool); t++)
        block_free(&b->blocks[t]);
    free(b->blocks);
    free(b->fine);
    free(b->traces);
    free(b->cell);
    free(b->live);
    free(b->weight);
    free(b->fold);
    geometry_clear(&b->geometry);
    free(b);
}

static int allocate(struct backprojection *b)
{
    size_t n = n_traces(b);
    b->fine = malloc(b->upsampling * TAPS * sizeof *b->fine);
    b->traces = calloc(n * b->n_stored, sizeof *b->traces);
    b->cell = malloc(n * sizeof *b->cell);
    b->live = calloc(n, sizeof *b->live);
    b->weight = calloc(n, sizeof *b->weight);
    b->blocks = calloc(pool_threads(b->pool), sizeof *b->blocks);
    if (!b->fine || !b->traces || !b->cell || !b->live || !b->weight || !b->blocks)
        return -ENOMEM;
    int err = number_midpoints(b);
    b->fold = err ? NULL : malloc(b->n_cells * sizeof *b->fold);
    if (!err && !b->fold)
        err = -ENOMEM;
    size_t elements = b->geometry.n_speakers + b->geometry.n_microphones;
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++)
        err = block_allocate(&b->blocks[t], b->n_block, elements);
    return err;
}

static int backprojection_create(void **state, const struct imager_config *cfg,
                                 const char **why)
{
    (void)why;
    struct backprojection *b = calloc(1, sizeof *b);
    if (!b)
        return -ENOMEM;
    double band_hz = cfg->band_hz[1] - cfg->band_hz[0];
    b->in = cfg->format;
    b->grid = cfg->grid;
    b->pool = cfg->pool;
    b->upsampling = (size_t)fmax(ceil(OVERSAMPLING * band_hz / b->in.rate_hz), 1.0);
    b->rate_hz = b->in.rate_hz * (double)b->upsampling;
    b->n_stored = b->in.n_samples * b->upsampling + 2;
    b->n_block = b->grid.n[0] * BLOCK_ROWS;
    double mute_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s - b->in.t0_s;
    b->muted = (size_t)fmax(ceil(mute_s * b->rate_hz), 0.0);
    int err = geometry_copy(&b->geometry, cfg->geometry);
    if (!err)
        err = allocate(b);
    if (err) {
        backprojection_destroy(b);
        return err;
    }
    for (size_t f = 0; f < b->upsampling; f++)
        sinc_weights(TAPS, fmin(band_hz / b->in.rate_hz, 0.95),
                     (double)f / (double)b->upsampling, b->fine + f * TAPS);
    *state = b;
    return 0;
}

/* -- add --------------------------------------------------------------------------------
 */

/* Stored sample q stands at input sample (q - 1) / upsampling. */
static void store_trace(const struct backprojection *b, const float complex *in,
                        float complex *out)
{
    long n = (long)b->in.n_samples;
    for (size_t q = 1; q + 1 < b->n_stored; q++) {
        if (q < b->muted + 1) {
            out[q] = 0.0f;
            continue;
        }
        long first = (long)((q - 1) / b->upsampling) - (HALF_TAPS - 1);
        const double *w = b->fine + (q - 1) % b->upsampling * TAPS;
        double re = 0.0, im = 0.0;
        for (long l = 0; l < TAPS; l++) {
            long at = first + l;
            if (at < 0 || at >= n)
                continue;
            re += w[l] * crealf(in[at]);
            im += w[l] * cimagf(in[at]);
        }
        ((float *)&out[q])[0] = (float)re;
        ((float *)&out[q])[1] = (float)im;
    }
}

static void backprojection_add(void *state, size_t position, size_t speaker,
                               const float complex *traces, const bool *masked)
{
    struct backprojection *b = state;
    size_t n = b->geometry.n_microphones;
    for (size_t i = 0; i < n; i++) {
        if (masked && masked[i])
            continue;
        size_t t = position * n_pairs(b) + speaker * n + i;
        store_trace(b, traces + i * b->in.n_samples, b->traces + t * b->n_stored);
        b->live[t] = true;
    }
}

static void backprojection_reset(void *state)
{
    struct backprojection *b = state;
    memset(b->live, 0, n_traces(b) * sizeof *b->live);
}

/* -- image ------------------------------------------------------------------------------
 */

/* Delay in stored samples and carrier phasor from one element to n voxels.  Each pair
 * sums two of them, so each carries half of the trace's start. */
VECTOR_CLONES
static void element_delays(const struct backprojection *b, const double at[3],
                           const struct block *s, size_t n, float *restrict delay,
                           float *restrict re, float *restrict im)
{
    float ex = (float)at[0], ey = (float)at[1], ez = (float)at[2];
    float per_m = (float)(b->rate_hz / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->in.t0_s * b->rate_hz));
    float turns_per_m = (float)(b->in.carrier_hz / b->geometry.sound_speed_m_s);
    const float *x = s->position[0], *y = s->position[1], *z = s->position[2];
    for (size_t v = 0; v < n; v++) {
        float dx = x[v] - ex, dy = y[v] - ey, dz = z[v] - ez;
        float r = sqrtf(dx * dx + dy * dy + dz * dz);
        delay[v] = r * per_m + start;
        phasor(r * turns_per_m, &re[v], &im[v]);
    }
}

/* sum += weight * phasor * trace(delay_s + delay_m), linear between stored samples; a
 * trace ends in zeros, and delays outside it are held there. */
VECTOR_CLONES
static void add_pair(const float *restrict trace, float last, float weight, size_t n,
                     const float *restrict delay_s, const float *restrict delay_m,
                     const float *restrict re, const float *restrict im,
                     float *restrict sum_re, float *restrict sum_im)
{
    for (size_t v = 0; v < n; v++) {
        float at = delay_s[v] + delay_m[v];
        at = at < 0.0f ? 0.0f : at;
        at = at > last ? last : at;
        int q = (int)at;
        float f = at - (float)q;
        float ar = trace[2 * q], ai = trace[2 * q + 1];
        float br = trace[2 * q + 2], bi = trace[2 * q + 3];
        float xr = weight * (ar + f * (br - ar)), xi = weight * (ai + f * (bi - ai));
        sum_re[v] += xr * re[v] - xi * im[v];
        sum_im[v] += xr * im[v] + xi * re[v];
    }
}

VECTOR_CLONES
static void add_part(size_t n, const float *restrict re, const float *restrict im,
                     const struct block *s)
{
    for (size_t v = 0; v < n; v++) {
        s->sum_re[v] += s->part_re[v] * re[v] - s->part_im[v] * im[v];
        s->sum_im[v] += s->part_re[v] * im[v] + s->part_im[v] * re[v];
    }
}

static void add_position(const struct backprojection *b, size_t k, const struct block *s,
                         size_t n)
{
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    for (size_t e = 0; e < n_s + n_m; e++) {
        double at[3];
        if (e < n_s)
            geometry_speaker(&b->geometry, k, e, at);
        else
            geometry_microphone(&b->geometry, k, e - n_s, at);
        element_delays(b, at, s, n, s->delay + e * n, s->phasor_re + e * n,
                       s->phasor_im + e * n);
    }
    for (size_t j = 0; j < n_s; j++) {
        memset(s->part_re, 0, n * sizeof *s->part_re);
        memset(s->part_im, 0, n * sizeof *s->part_im);
        for (size_t i = 0; i < n_m; i++) {
            size_t t = k * n_pairs(b) + j * n_m + i, m = n_s + i;
            if (b->live[t])
                add_pair((const float *)(b->traces + t * b->n_stored),
                         (float)(b->n_stored - 2), b->weight[t], n, s->delay + j * n,
                         s->delay + m * n, s->phasor_re + m * n, s->phasor_im + m * n,
                         s->part_re, s->part_im);
        }
        add_part(n, s->phasor_re + j * n, s->phasor_im + j * n, s);
    }
}

static void image_block(void *ctx, size_t item, size_t thread)
{
    struct backprojection *b = ctx;
    const struct block *s = &b->blocks[thread];
    const struct grid *g = &b->grid;
    size_t first = item * b->n_block, n = grid_size(g) - first;
    n = n < b->n_block ? n : b->n_block;
    for (size_t v = 0; v < n; v++) {
        size_t at[3] = {(first + v) % g->n[0], (first + v) / g->n[0] % g->n[1],
                        (first + v) / (g->n[0] * g->n[1])};
        for (int a = 0; a < 3; a++)
            s->position[a][v] = (float)(g->origin_m[a] + g->step_m[a] * (double)at[a]);
    }
    memset(s->sum_re, 0, n * sizeof *s->sum_re);
    memset(s->sum_im, 0, n * sizeof *s->sum_im);
    for (size_t k = 0; k < b->geometry.n_positions; k++)
        add_position(b, k, s, n);
    for (size_t v = 0; v < n; v++) {
        float depth = s->position[2][v];
        float gain = depth * depth;
        b->image[first + v] = gain *
                              (s->sum_re[v] * s->sum_re[v] + s->sum_im[v] * s->sum_im[v]);
    }
}

/* Every midpoint counts once, however many live pairs share it. */
static void weigh(struct backprojection *b)
{
    memset(b->fold, 0, b->n_cells * sizeof *b->fold);
    for (size_t t = 0; t < n_traces(b); t++)
        b->fold[b->cell[t]] += b->live[t];
    for (size_t t = 0; t < n_traces(b); t++)
        b->weight[t] = b->live[t] ? 1.0f / (float)(b->fold[b->cell[t]] * b->n_cells)
                                  : 0.0f;
}

static void backprojection_image(void *state, float *intensity)
{
    struct backprojection *b = state;
    weigh(b);
    b->image = intensity;
    pool_run(b->pool, (grid_size(&b->grid) + b->n_block - 1) / b->n_block, image_block,
             b);
}

const struct imager_method method_backprojection = {
    .name = "backprojection",
    .create = backprojection_create,
    .add = backprojection_add,
    .image = backprojection_image,
    .reset = backprojection_reset,
    .destroy = backprojection_destroy,
};
