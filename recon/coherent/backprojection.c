/* SPDX-License-Identifier: MIT */
/* recon/coherent/backprojection.c -- `--method backprojection`: each voxel sums every
 * pair's trace at its own two-way delay, phase kept, each pair weighted by 1 / (pairs
 * that share its midpoint).  Traces are stored finer than they come, so that linear
 * interpolation does (recon/coherent/fine_trace.h): -50 dB of double precision in all.
 *
 * The coherence factor (Mallart and Fink 1994, "Adaptive focusing in scattering media
 * through sound-speed inhomogeneities") of a voxel is what its pairs add up to over what
 * they would, were all in phase: |sum w x|^2 / (sum w  sum w |x|^2), with the pairs'
 * weights w.  The intensity is multiplied by its power `coherence`. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/coherent/backproject_tile.h"
#include "recon/coherent/fine_trace.h"
#include "recon/coherent/phasor.h"
#include "recon/imaging/fold.h"
#include "recon/imaging/method.h"

#define CACHE_LINE 64
#define LANE_BLOCK 16 /* lanes of a group are padded to a multiple of this */

struct backprojection {
    struct geometry geometry;
    struct grid grid;
    struct pool *pool;
    double plane_z_m;             /* depth counts from here: the middle of the array */
    double centre_m[3], spread_m; /* of pings with places of their own: mean, rms */
    float coherence;              /* exponent; 0: off */

    struct fine_trace fine;
    float complex *added; /* [position][pair][fine.in.n_samples] as they came */

    /* Stored samples, fine.n_stored of a trace.  A scan's lie in groups of `lanes`,
     * [pair][n_stored][re, im][lanes] with the stage positions in the lanes, each trace
     * over the live pairs of its midpoint.  Otherwise they are packed in words,
     * [position][pair][n_stored]. */
    bool scan;
    size_t lanes;
    float *traces;
    uint32_t *words;
    float *unit; /* [position][pair] */

    uint32_t *cell; /* [position][pair]: number of its midpoint */
    size_t n_cells, n_live_cells;
    bool *live;            /* [position][pair]: added, not masked */
    uint32_t *fold;        /* [n_cells]: live pairs of each midpoint */
    uint32_t *stored_fold; /* [position][pair]: that of its midpoint, 0 if not live, when
                              it was stored; STORE_STALE: what is stored is old */
    void *scratch;         /* of the imaging part */
    float *image;          /* where imager_image wants it */

    size_t stride;  /* scan: voxels between two stage positions */
    double first_m; /* scan: x of stage position 0 */
};

#define STORE_STALE UINT32_MAX

static size_t pairs_of(const struct backprojection *b)
{
    return b->geometry.n_speakers * b->geometry.n_microphones;
}

/* Of a scan: a stored sample of a pair at all positions, [re, im][lanes]. */
static float *sample_of(const struct backprojection *b, size_t pair, size_t sample)
{
    return b->traces + (pair * b->fine.n_stored + sample) * 2 * b->lanes;
}

static size_t n_traces(const struct backprojection *b)
{
    return pairs_of(b) * b->geometry.n_positions;
}

/* What stands for the depth of a voxel: its distance from the array's plane, or, where
 * pings have places of their own and there is no plane, the rms distance from them. */
static float depth_of(const struct backprojection *b, float x_m, float y_m, float z_m)
{
    if (!b->geometry.pings_m)
        return z_m - (float)b->plane_z_m;
    float dx = x_m - (float)b->centre_m[0], dy = y_m - (float)b->centre_m[1];
    float dz = z_m - (float)b->centre_m[2], spread = (float)b->spread_m;
    return sqrtf(dx * dx + dy * dy + dz * dz + spread * spread);
}

/* Of the sum of all stored traces, and of the sum of their fold * |x|^2, which counts if
 * coherence does.  Depth makes up for spreading, once: echoes of a point fade faster, of
 * a plate slower. */
static float intensity_of(const struct backprojection *b, float depth_m, float re,
                          float im, float power)
{
    float sum2 = re * re + im * im, scale = depth_m / (float)b->n_cells;
    float out = scale * scale * sum2;
    if (b->coherence == 0.0f || out == 0.0f)
        return out;
    float factor = sum2 / ((float)b->n_live_cells * power);
    return out * powf(fminf(factor, 1.0f), b->coherence);
}

/* -- traces as they came to the finer ones that are read by linear interpolation --------
 */

/* Whole cache lines, so that no vector of traces straddles two. */
static size_t lines_of(size_t bytes)
{
    return (bytes + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE;
}

static int store_allocate(struct backprojection *b)
{
    size_t n = n_traces(b);
    size_t n_stored = b->fine.n_stored;
    size_t lanes = lines_of(pairs_of(b) * n_stored * 2 * b->lanes * sizeof *b->traces);
    b->added = malloc(n * b->fine.in.n_samples * sizeof *b->added);
    b->stored_fold = calloc(n, sizeof *b->stored_fold);
    if (b->scan) {
        b->traces = aligned_alloc(CACHE_LINE, lanes);
        if (b->traces)
            memset(b->traces, 0, lanes);
    } else {
        b->words = calloc(n * n_stored, sizeof *b->words);
        b->unit = malloc(n * sizeof *b->unit);
    }
    bool stored = b->scan ? b->traces != NULL : b->words && b->unit;
    return stored && b->added && b->stored_fold ? 0 : -ENOMEM;
}

static int store_create(struct backprojection *b, const struct trace_format *in,
                        double band_hz, double gate_s)
{
    int err = fine_trace_create(&b->fine, in, band_hz, gate_s, pool_threads(b->pool));
    return err ? err : store_allocate(b);
}

static void store_destroy(struct backprojection *b)
{
    fine_trace_clear(&b->fine);
    free(b->added);
    free(b->traces);
    free(b->words);
    free(b->unit);
    free(b->stored_fold);
}

/* Stored sample q stands at input sample (q - 1) / upsampling. */
static void store_lane(const struct backprojection *b, const float *const fine[2],
                       uint32_t fold, float *out)
{
    size_t n = b->fine.in.n_samples, upsampling = b->fine.upsampling;
    float weight = fold ? 1.0f / (float)fold : 0.0f;
    for (size_t f = 0; f < upsampling; f++) {
        for (size_t q = 0; q < n; q++) {
            float *x = out + (1 + q * upsampling + f) * 2 * b->lanes;
            x[0] = weight * fine[0][f * n + q];
            x[b->lanes] = weight * fine[1][f * n + q];
        }
    }
}

static void store_scan(const struct backprojection *b, size_t thread, size_t t,
                       uint32_t fold)
{
    size_t pairs = pairs_of(b);
    const float *fine[2];
    fine_trace_refine(&b->fine, thread, b->added + t * b->fine.in.n_samples, fine);
    store_lane(b, fine, fold, sample_of(b, t % pairs, 0) + t / pairs);
}

static void store_trace(struct backprojection *b, size_t thread, size_t t)
{
    uint32_t fold = b->live[t] ? b->fold[b->cell[t]] : 0;
    bool old = b->stored_fold[t] == STORE_STALE;
    if (b->scan && fold != b->stored_fold[t])
        store_scan(b, thread, t, fold);
    else if (!b->scan && old && fold)
        b->unit[t] = fine_trace_words(&b->fine, thread,
                                      b->added + t * b->fine.in.n_samples,
                                      b->words + t * b->fine.n_stored);
    b->stored_fold[t] = fold;
}

static void store_pair(void *ctx, size_t pair, size_t thread)
{
    struct backprojection *b = ctx;
    for (size_t k = 0; k < b->geometry.n_positions; k++)
        store_trace(b, thread, k * pairs_of(b) + pair);
}

static void store_position(void *ctx, size_t position, size_t thread)
{
    struct backprojection *b = ctx;
    for (size_t pair = 0; pair < pairs_of(b); pair++)
        store_trace(b, thread, position * pairs_of(b) + pair);
}

/* Only what is not up to date.  Every midpoint counts once, however many live pairs share
 * it. */
static void store_traces(struct backprojection *b)
{
    memset(b->fold, 0, b->n_cells * sizeof *b->fold);
    for (size_t t = 0; t < n_traces(b); t++)
        b->fold[b->cell[t]] += b->live[t];
    b->n_live_cells = 0;
    for (size_t c = 0; c < b->n_cells; c++)
        b->n_live_cells += b->fold[c] > 0;
    if (b->scan)
        pool_run(b->pool, pairs_of(b), store_pair, b);
    else
        pool_run(b->pool, b->geometry.n_positions, store_position, b);
}

/* -- all voxels, for any geometry: tile by tile -----------------------------------------
 */

struct any_scratch { /* one a thread */
    struct tile tile;
    struct tile_path *paths; /* [elements], or one of both ways */
};

static int any_create(struct backprojection *b)
{
    struct any_scratch *own = calloc(pool_threads(b->pool), sizeof *own);
    if (!own)
        return -ENOMEM;
    b->scratch = own;
    size_t elements = b->geometry.n_speakers + b->geometry.n_microphones;
    for (size_t t = 0; t < pool_threads(b->pool); t++)
        if (!(own[t].paths = malloc(elements * sizeof *own[t].paths)))
            return -ENOMEM;
    return 0;
}

static void any_destroy(struct backprojection *b)
{
    struct any_scratch *own = b->scratch;
    for (size_t t = 0; own && t < pool_threads(b->pool); t++)
        free(own[t].paths);
    free(own);
}

static struct tile_trace trace_of(const struct backprojection *b, size_t t)
{
    struct tile_trace r = {.words = b->words + t * b->fine.n_stored,
                           .last = (float)(b->fine.n_stored - 2),
                           .scale = b->unit[t] / (float)b->stored_fold[t]};
    r.power = r.scale * b->unit[t];
    return r;
}

static void add_trace(const struct backprojection *b, size_t t, struct tile *tile,
                      const struct tile_path *to, const struct tile_path *from,
                      float sum[2][TILE_VOXELS])
{
    if (!b->stored_fold[t])
        return;
    const struct tile_trace r = trace_of(b, t);
    tile_add(tile, &r, to, from, sum, b->coherence > 0.0f ? tile->squares : NULL);
}

static void add_ping(const struct backprojection *b, const struct tile_sound *sound,
                     size_t k, struct any_scratch *own)
{
    double speaker[3], microphone[3];
    geometry_speaker(&b->geometry, k, 0, speaker);
    geometry_microphone(&b->geometry, k, 0, 0, microphone);
    tile_round_trip(&own->tile, sound, speaker, microphone, own->paths);
    add_trace(b, k, &own->tile, own->paths, own->paths, own->tile.sum);
}

/* Where the microphones are when they hear a speaker. */
static void find_microphones(const struct backprojection *b,
                             const struct tile_sound *sound, size_t k, size_t speaker,
                             struct any_scratch *own)
{
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    for (size_t i = 0; i < n_m; i++) {
        double at[3];
        geometry_microphone(&b->geometry, k, speaker, i, at);
        tile_path(&own->tile, sound, at, 0.0, &own->paths[n_s + i]);
    }
}

static void add_position(const struct backprojection *b, const struct tile_sound *sound,
                         size_t k, struct any_scratch *own)
{
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    for (size_t e = 0; e < n_s; e++) {
        double at[3];
        geometry_speaker(&b->geometry, k, e, at);
        tile_path(&own->tile, sound, at, 0.0, &own->paths[e]);
    }
    for (size_t j = 0; j < n_s; j++) {
        if (j == 0 || geometry_place(&b->geometry, j))
            find_microphones(b, sound, k, j, own);
        const struct tile_path *to = &own->paths[j], *from = &own->paths[n_s];
        size_t t = (k * n_s + j) * n_m;
        for (size_t i = 0; i < n_m; i++) {
            const struct tile_trace next = {.words = b->words +
                                                     (t + i + 1) * b->fine.n_stored,
                                            .last = (float)(b->fine.n_stored - 2)};
            if (i + 1 < n_m)
                tile_fetch(&own->tile, &next, to, from + i + 1);
            add_trace(b, t + i, &own->tile, to, from + i, own->tile.part);
        }
        tile_add_part(&own->tile, to);
    }
}

static void image_tile(void *ctx, size_t item, size_t thread)
{
    struct backprojection *b = ctx;
    struct any_scratch *own = (struct any_scratch *)b->scratch + thread;
    struct tile *tile = &own->tile;
    struct tile_sound sound;
    tile_sound(&sound, &b->fine, b->geometry.sound_speed_m_s);
    tile_lay(tile, &b->grid, item);
    for (size_t k = 0; k < b->geometry.n_positions; k++) {
        if (pairs_of(b) == 1)
            add_ping(b, &sound, k, own);
        else
            add_position(b, &sound, k, own);
    }
    for (size_t v = 0; v < tile->n; v++) {
        float depth_m =
            depth_of(b, tile->position[0][v], tile->position[1][v], tile->position[2][v]);
        b->image[tile->number[v]] =
            intensity_of(b, depth_m, tile->sum[0][v], tile->sum[1][v], tile->squares[v]);
    }
}

static void any_image(struct backprojection *b)
{
    pool_run(b->pool, tile_count(&b->grid), image_tile, b);
}

/* -- all voxels, for an array that a stage carries along x: several times as fast -------
 */

/* The delay of a pair depends on x_voxel - x_stage only, and stage steps are whole
 * voxels: for one difference all stage positions read the same sample, each for its own
 * voxel.  So stage positions lie in the lanes, and nothing is looked up voxel by voxel.
 *
 * A few pairs at a time are summed for a block of near differences at a few depths: the
 * samples that these share stay in the first cache.  "Differences" are those of a voxel's
 * and a stage position's x, in voxels. */

/* Heights and depths that are imaged together: near ones read the same samples, which
 * come from far. */
#define ROWS_Y 4
#define ROWS_Z 4
#define ROWS   (ROWS_Y * ROWS_Z)
#define BLOCK  16 /* differences that are summed together */
#define CHUNK  8  /* microphones of one speaker that are summed together */
#define SUMS   3  /* re, im, power */

struct reading { /* of one pair's trace, for each difference of a block */
    const float *trace;
    int sample[BLOCK];
    float near[2][BLOCK]; /* weight of that sample: re, im */
    float far[2][BLOCK];  /* of the next one */
    const float *fold;    /* [lanes] */
};

struct row {
    size_t y, z;      /* in the image */
    float *delay;     /* [elements][BLOCK] in stored samples */
    float *phasor[2]; /* [elements][BLOCK] */
    float *block;     /* [BLOCK][SUMS][lanes]: of one block of differences */
    float *sum[SUMS]; /* [stride][n_sum]: voxels of one remainder lie side by side */
};

struct sweep {    /* one a thread */
    size_t n_d;   /* differences */
    size_t n_sum; /* voxels of one remainder, with the lanes' overhang on both sides */
    struct row rows[ROWS];
    struct reading readings[CHUNK];
};

struct scan {
    struct sweep *sweeps; /* one a thread */
    float *fold;          /* [pair][lanes] live pairs of the trace's midpoint */
};

/* The speakers, and the microphones when they hear each of them: on a stage that does not
 * stop they have gone on. */
static inline size_t n_elements(const struct backprojection *b)
{
    const struct geometry *g = &b->geometry;
    return g->n_speakers + g->n_microphones * geometry_places(g);
}

/* Beside the stage's position. */
static void element_place(const struct geometry *g, size_t e, double at[3])
{
    size_t m = e - g->n_speakers;
    bool speaker = e < g->n_speakers;
    double on_m = geometry_gone_on_m(g, speaker ? e : m / g->n_microphones);
    memcpy(at, speaker ? g->speakers_m[e] : g->microphones_m[m % g->n_microphones],
           3 * sizeof *at);
    at[0] += speaker ? on_m : on_m + g->echo_m;
}

/* Does the geometry fit?  Sets stride and first_m. */
static bool scan_fits(struct backprojection *b)
{
    const struct geometry *g = &b->geometry;
    b->stride = geometry_stage_stride(g, b->grid.step_m[0]);
    if (!b->stride || g->n_positions < VECTOR_LANES)
        return false;
    b->first_m = g->stage_positions_m[0];
    return true;
}

static int row_create(struct row *w, const struct backprojection *b, size_t n_sum)
{
    size_t n = n_elements(b) * BLOCK, sums = b->stride * n_sum;
    w->delay = malloc(n * sizeof *w->delay);
    w->block = aligned_alloc(64, BLOCK * SUMS * b->lanes * sizeof *w->block);
    bool ok = w->delay && w->block;
    for (int a = 0; a < 2; a++)
        ok = (w->phasor[a] = malloc(n * sizeof *w->phasor[a])) && ok;
    for (int a = 0; a < SUMS; a++)
        ok = (w->sum[a] = malloc(sums * sizeof *w->sum[a])) && ok;
    return ok ? 0 : -ENOMEM;
}

static void row_clear(struct row *w)
{
    free(w->delay);
    free(w->block);
    for (int a = 0; a < 2; a++)
        free(w->phasor[a]);
    for (int a = 0; a < SUMS; a++)
        free(w->sum[a]);
}

static int scan_create(struct backprojection *b)
{
    struct scan *scan = calloc(1, sizeof *scan);
    if (!scan)
        return -ENOMEM;
    b->scratch = scan;
    scan->sweeps = calloc(pool_threads(b->pool), sizeof *scan->sweeps);
    scan->fold = calloc(pairs_of(b) * b->lanes, sizeof *scan->fold);
    int err = scan->sweeps && scan->fold ? 0 : -ENOMEM;
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++) {
        struct sweep *s = &scan->sweeps[t];
        s->n_d = b->grid.n[0] + (b->lanes - 1) * b->stride;
        s->n_sum = (b->grid.n[0] + b->stride - 1) / b->stride + 2 * b->lanes +
                   VECTOR_LANES;
        for (size_t r = 0; !err && r < ROWS; r++)
            err = row_create(&s->rows[r], b, s->n_sum);
    }
    return err;
}

static void scan_destroy(struct backprojection *b)
{
    struct scan *scan = b->scratch;
    if (!scan)
        return;
    for (size_t t = 0; scan->sweeps && t < pool_threads(b->pool); t++)
        for (size_t r = 0; r < ROWS; r++)
            row_clear(&scan->sweeps[t].rows[r]);
    free(scan->sweeps);
    free(scan->fold);
    free(scan);
}

/* Of BLOCK differences from x0 on. */
VECTOR_CLONES
static void element_delays(const struct backprojection *b, double x0_m, double beside2_m2,
                           float *restrict delay, float *restrict re, float *restrict im)
{
    float per_m = (float)(b->fine.rate_hz / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->fine.in.t0_s * b->fine.rate_hz));
    float turns_per_m = (float)(b->fine.in.carrier_hz / b->geometry.sound_speed_m_s);
    float x0 = (float)x0_m, step = (float)b->grid.step_m[0], beside2 = (float)beside2_m2;
    for (size_t d = 0; d < BLOCK; d++) {
        float dx = x0 + step * (float)(int)d;
        float r = sqrtf(dx * dx + beside2);
        delay[d] = r * per_m + start;
        phasor(r * turns_per_m, &re[d], &im[d]);
    }
}

/* Difference d stands for x_voxel - x_stage = origin - first + (d - back) * step. */
static void row_start_block(const struct backprojection *b, struct row *w, size_t first)
{
    const struct geometry *g = &b->geometry;
    double y_m = b->grid.origin_m[1] + b->grid.step_m[1] * (double)w->y;
    double z_m = b->grid.origin_m[2] + b->grid.step_m[2] * (double)w->z;
    double d = (double)first - (double)((b->lanes - 1) * b->stride);
    double x_m = b->grid.origin_m[0] - b->first_m + d * b->grid.step_m[0];
    for (size_t e = 0; e < n_elements(b); e++) {
        double at[3];
        element_place(g, e, at);
        double dy = y_m - at[1], dz = z_m - at[2];
        element_delays(b, x_m - at[0], dy * dy + dz * dz, w->delay + e * BLOCK,
                       w->phasor[0] + e * BLOCK, w->phasor[1] + e * BLOCK);
    }
    memset(w->block, 0, BLOCK * SUMS * b->lanes * sizeof *w->block);
}

/* Which samples a block of differences reads, and with what complex weights. */
VECTOR_CLONES
static void plan_reading(const struct row *w, size_t speaker, size_t microphone,
                         float last, struct reading *restrict out)
{
    const float *delay_s = w->delay + speaker * BLOCK;
    const float *delay_m = w->delay + microphone * BLOCK;
    const float *sr = w->phasor[0] + speaker * BLOCK,
                *si = w->phasor[1] + speaker * BLOCK;
    const float *mr = w->phasor[0] + microphone * BLOCK;
    const float *mi = w->phasor[1] + microphone * BLOCK;
    for (size_t d = 0; d < BLOCK; d++) {
        float at = delay_s[d] + delay_m[d];
        at = at < 0.0f ? 0.0f : at;
        at = at > last ? last : at;
        int sample = (int)at;
        float f = at - (float)sample;
        float re = sr[d] * mr[d] - si[d] * mi[d], im = sr[d] * mi[d] + si[d] * mr[d];
        out->sample[d] = sample;
        out->far[0][d] = f * re;
        out->far[1][d] = f * im;
        out->near[0][d] = re - f * re;
        out->near[1][d] = im - f * im;
    }
}

/* sum[SUMS][lanes] += what n pairs add to difference d for the lanes from k on.  Two
 * short loops rather than one: a single one GCC 12 interleaves over i, and then makes no
 * vectors of it. */
VECTOR_INLINE void add_lanes(const struct reading *readings, size_t n, size_t lanes,
                             size_t k, size_t d, float *sum, bool power)
{
    float re[VECTOR_LANES], im[VECTOR_LANES];
    float re_far[VECTOR_LANES] = {0}, im_far[VECTOR_LANES] = {0};
    float squares[VECTOR_LANES] = {0}, zr[VECTOR_LANES], zi[VECTOR_LANES];
    memcpy(re, sum + k, sizeof re);
    memcpy(im, sum + lanes + k, sizeof im);
    if (power)
        memcpy(squares, sum + 2 * lanes + k, sizeof squares);
    for (size_t i = 0; i < n; i++) {
        const struct reading *r = &readings[i];
        const float *x = r->trace + (size_t)(unsigned)r->sample[d] * 2 * lanes + k;
        const float *xr = x, *xi = x + lanes, *yr = x + 2 * lanes, *yi = x + 3 * lanes;
        const float *fold = r->fold + k;
        float ar = r->near[0][d], ai = r->near[1][d];
        float br = r->far[0][d], bi = r->far[1][d];
        for (size_t v = 0; power && v < VECTOR_LANES; v++) {
            zr[v] = ar * xr[v] - ai * xi[v] + br * yr[v] - bi * yi[v];
            zi[v] = ar * xi[v] + ai * xr[v] + br * yi[v] + bi * yr[v];
        }
        for (size_t v = 0; power && v < VECTOR_LANES; v++) {
            re[v] += zr[v];
            im[v] += zi[v];
            squares[v] += fold[v] * (zr[v] * zr[v] + zi[v] * zi[v]);
        }
        for (size_t v = 0; !power && v < VECTOR_LANES; v++) {
            re[v] += ar * xr[v];
            im[v] += ar * xi[v];
            re_far[v] += br * yr[v];
            im_far[v] += br * yi[v];
        }
        for (size_t v = 0; !power && v < VECTOR_LANES; v++) {
            re[v] -= ai * xi[v];
            im[v] += ai * xr[v];
            re_far[v] -= bi * yi[v];
            im_far[v] += bi * yr[v];
        }
    }
    for (size_t v = 0; v < VECTOR_LANES; v++) {
        re[v] += re_far[v];
        im[v] += im_far[v];
    }
    memcpy(sum + k, re, sizeof re);
    memcpy(sum + lanes + k, im, sizeof im);
    if (power)
        memcpy(sum + 2 * lanes + k, squares, sizeof squares);
}

VECTOR_CLONES
static void add_readings(const struct reading *readings, size_t n, size_t lanes, size_t k,
                         size_t first, size_t end, float *block)
{
    for (size_t d = first; d < end; d++)
        add_lanes(readings, n, lanes, k, d, block + d * SUMS * lanes, false);
}

VECTOR_CLONES
static void add_readings_power(const struct reading *readings, size_t n, size_t lanes,
                               size_t k, size_t first, size_t end, float *block)
{
    for (size_t d = first; d < end; d++)
        add_lanes(readings, n, lanes, k, d, block + d * SUMS * lanes, true);
}

/* Those differences of a block for which any of the lanes from k on is a voxel of the
 * image: lane k of difference d is voxel d - (lanes - 1 - k) * stride. */
static void range_of(const struct backprojection *b, size_t k, size_t block,
                     size_t *first, size_t *end)
{
    size_t low = (b->lanes - k - VECTOR_LANES) * b->stride;
    size_t high = (b->lanes - 1 - k) * b->stride + b->grid.n[0];
    *first = low > block ? low - block : 0;
    *end = high > block ? high - block : 0;
    *end = *end < BLOCK ? *end : BLOCK;
}

static void add_chunk(const struct backprojection *b, struct sweep *s, struct row *w,
                      size_t block, size_t speaker, size_t first, size_t n)
{
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    const struct scan *scan = b->scratch;
    size_t microphones = n_s + geometry_place(&b->geometry, speaker) * n_m;
    for (size_t i = 0; i < n; i++) {
        size_t pair = speaker * n_m + first + i;
        s->readings[i].trace = sample_of(b, pair, 0);
        s->readings[i].fold = scan->fold + pair * b->lanes;
        plan_reading(w, speaker, microphones + first + i, (float)(b->fine.n_stored - 2),
                     &s->readings[i]);
    }
    for (size_t k = 0; k < b->lanes; k += VECTOR_LANES) {
        size_t d, end;
        range_of(b, k, block, &d, &end);
        if (d >= end)
            continue;
        if (b->coherence > 0.0f)
            add_readings_power(s->readings, n, b->lanes, k, d, end, w->block);
        else
            add_readings(s->readings, n, b->lanes, k, d, end, w->block);
    }
}

/* Lane k of difference d belongs to voxel d - (lanes - 1) * stride + k * stride; those
 * outside the image go to the overhang. */
VECTOR_CLONES
static void spread_block(const struct backprojection *b, const struct sweep *s,
                         const struct row *w, size_t block)
{
    int n_sums = b->coherence > 0.0f ? SUMS : SUMS - 1;
    for (size_t d = 0; d < BLOCK && block + d < s->n_d; d++) {
        size_t voxel = block + d + b->stride;
        size_t at = voxel % b->stride * s->n_sum + voxel / b->stride;
        for (int a = 0; a < n_sums; a++) {
            const float *restrict from = w->block + (d * SUMS + (size_t)a) * b->lanes;
            float *restrict to = w->sum[a] + at;
            for (size_t k = 0; k < b->lanes; k++)
                to[k] += from[k];
        }
    }
}

static void row_finish(const struct backprojection *b, const struct sweep *s,
                       const struct row *w)
{
    const struct grid *g = &b->grid;
    float depth_m = (float)(g->origin_m[2] + g->step_m[2] * (double)w->z - b->plane_z_m);
    float *out = b->image + (w->z * g->n[1] + w->y) * g->n[0];
    for (size_t x = 0; x < g->n[0]; x++) {
        size_t voxel = x + b->stride * b->lanes;
        size_t at = voxel % b->stride * s->n_sum + voxel / b->stride;
        out[x] = intensity_of(b, depth_m, w->sum[0][at], w->sum[1][at], w->sum[2][at]);
    }
}

static size_t tiles_along(const struct backprojection *b, int axis)
{
    size_t side = axis == 1 ? ROWS_Y : ROWS_Z;
    return (b->grid.n[axis] + side - 1) / side;
}

/* Returns how many rows there are. */
static size_t rows_start(const struct backprojection *b, struct sweep *s, size_t item)
{
    const struct grid *g = &b->grid;
    size_t y0 = item % tiles_along(b, 1) * ROWS_Y, z0 = item / tiles_along(b, 1) * ROWS_Z;
    size_t n = 0;
    for (size_t y = y0; y < g->n[1] && y < y0 + ROWS_Y; y++) {
        for (size_t z = z0; z < g->n[2] && z < z0 + ROWS_Z; z++) {
            struct row *w = &s->rows[n++];
            w->y = y;
            w->z = z;
            for (int a = 0; a < SUMS; a++)
                memset(w->sum[a], 0, b->stride * s->n_sum * sizeof *w->sum[a]);
        }
    }
    return n;
}

static void image_rows(void *ctx, size_t item, size_t thread)
{
    struct backprojection *b = ctx;
    struct sweep *s = ((struct scan *)b->scratch)->sweeps + thread;
    size_t n_m = b->geometry.n_microphones, n_rows = rows_start(b, s, item);
    for (size_t block = 0; block < s->n_d; block += BLOCK) {
        for (size_t r = 0; r < n_rows; r++)
            row_start_block(b, &s->rows[r], block);
        for (size_t j = 0; j < b->geometry.n_speakers; j++)
            for (size_t i = 0; i < n_m; i += CHUNK)
                for (size_t r = 0; r < n_rows; r++)
                    add_chunk(b, s, &s->rows[r], block, j, i,
                              n_m - i < CHUNK ? n_m - i : CHUNK);
        for (size_t r = 0; r < n_rows; r++)
            spread_block(b, s, &s->rows[r], block);
    }
    for (size_t r = 0; r < n_rows; r++)
        row_finish(b, s, &s->rows[r]);
}

static void find_folds(const struct backprojection *b)
{
    const struct scan *scan = b->scratch;
    size_t pairs = pairs_of(b);
    for (size_t t = 0; t < pairs * b->geometry.n_positions; t++)
        scan->fold[t % pairs * b->lanes + t / pairs] = (float)b->stored_fold[t];
}

static void scan_image(struct backprojection *b)
{
    find_folds(b);
    pool_run(b->pool, tiles_along(b, 1) * tiles_along(b, 2), image_rows, b);
}

/* -- create -----------------------------------------------------------------------------
 */

static void backprojection_destroy(void *state)
{
    struct backprojection *b = state;
    if (!b)
        return;
    if (b->scan)
        scan_destroy(b);
    else
        any_destroy(b);
    store_destroy(b);
    free(b->cell);
    free(b->live);
    free(b->fold);
    geometry_clear(&b->geometry);
    free(b);
}

static int allocate(struct backprojection *b, const struct imager_config *cfg)
{
    size_t n = n_traces(b);
    b->cell = malloc(n * sizeof *b->cell);
    b->live = calloc(n, sizeof *b->live);
    if (!b->cell || !b->live)
        return -ENOMEM;
    int err = fold_number(&b->geometry, b->cell, &b->n_cells);
    if (err)
        return err;
    b->fold = malloc(b->n_cells * sizeof *b->fold);
    if (!b->fold)
        return -ENOMEM;
    double gate_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s;
    err = store_create(b, &cfg->format, cfg->band_hz[1] - cfg->band_hz[0], gate_s);
    if (err)
        return err;
    return b->scan ? scan_create(b) : any_create(b);
}

static double middle(const struct backprojection *b, size_t t, int axis)
{
    const struct geometry *g = &b->geometry;
    size_t k = t / pairs_of(b), pair = t % pairs_of(b);
    double s[3], m[3];
    geometry_speaker(g, k, pair / g->n_microphones, s);
    geometry_microphone(g, k, pair / g->n_microphones, pair % g->n_microphones, m);
    return 0.5 * (s[axis] + m[axis]);
}

/* Mean and rms distance from it of the pairs' midpoints. */
static void find_centre(struct backprojection *b)
{
    size_t n = n_traces(b);
    double sum2 = 0.0;
    for (int a = 0; a < 3; a++) {
        double sum = 0.0;
        for (size_t t = 0; t < n; t++)
            sum += middle(b, t, a);
        b->centre_m[a] = sum / (double)n;
        for (size_t t = 0; t < n; t++)
            sum2 += pow(middle(b, t, a) - b->centre_m[a], 2.0);
    }
    b->spread_m = sqrt(sum2 / (double)n);
}

static int backprojection_create(void **state, const struct imager_config *cfg,
                                 const char **why)
{
    (void)why;
    struct backprojection *b = calloc(1, sizeof *b);
    if (!b)
        return -ENOMEM;
    b->grid = cfg->grid;
    b->pool = cfg->pool;
    b->coherence = cfg->options ? (float)cfg->options->coherence : 0.0f;
    double low[3], high[3];
    geometry_aperture(cfg->geometry, low, high);
    b->plane_z_m = 0.5 * (low[2] + high[2]);
    int err = geometry_copy(&b->geometry, cfg->geometry);
    if (!err) {
        if (b->geometry.pings_m)
            find_centre(b);
        b->scan = scan_fits(b);
        b->lanes = b->scan ? (b->geometry.n_positions + LANE_BLOCK - 1) / LANE_BLOCK *
                                 LANE_BLOCK
                           : 1;
        err = allocate(b, cfg);
    }
    if (err) {
        backprojection_destroy(b);
        return err;
    }
    *state = b;
    return 0;
}

/* -- add, image -------------------------------------------------------------------------
 */

static void backprojection_add(void *state, size_t position, size_t speaker,
                               const float complex *traces, const bool *masked)
{
    struct backprojection *b = state;
    size_t n = b->geometry.n_microphones, length = b->fine.in.n_samples;
    for (size_t i = 0; i < n; i++) {
        size_t t = position * pairs_of(b) + speaker * n + i;
        if (masked && masked[i])
            continue;
        memcpy(b->added + t * length, traces + i * length, length * sizeof *traces);
        b->live[t] = true;
        b->stored_fold[t] = STORE_STALE;
    }
}

static void backprojection_reset(void *state)
{
    struct backprojection *b = state;
    memset(b->live, 0, n_traces(b) * sizeof *b->live);
}

static void backprojection_image(void *state, float *intensity)
{
    struct backprojection *b = state;
    store_traces(b);
    b->image = intensity;
    if (b->scan)
        scan_image(b);
    else
        any_image(b);
}

const struct imager_method method_backprojection = {
    .name = "backprojection",
    .any_geometry = true,
    .continuous = true,
    .adds = true,
    .create = backprojection_create,
    .add = backprojection_add,
    .image = backprojection_image,
    .reset = backprojection_reset,
    .destroy = backprojection_destroy,
};
