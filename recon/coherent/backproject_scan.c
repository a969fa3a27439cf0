/* SPDX-License-Identifier: MIT */
/* recon/coherent/backproject_scan.c -- back-projection for an array that a stage carries
 * along x. The delay of a pair depends on x_voxel - x_stage only, and stage steps are
 * whole voxels: for one difference all stage positions read the same sample, each for its
 * own voxel.  So stage positions lie in the lanes, and nothing is looked up voxel by
 * voxel.
 *
 * A few pairs at a time are summed for a block of near differences at a few depths: the
 * samples that these share stay in the first cache. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/coherent/backprojection.h"
#include "recon/coherent/phasor.h"

/* "Differences" are those of a voxel's and a stage position's x, in voxels. */
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

bool backproject_scan_fits(struct backprojection *b)
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

int backproject_scan_create(struct backprojection *b)
{
    struct scan *scan = calloc(1, sizeof *scan);
    if (!scan)
        return -ENOMEM;
    b->scratch = scan;
    scan->sweeps = calloc(pool_threads(b->pool), sizeof *scan->sweeps);
    scan->fold = calloc(backprojection_pairs(b) * b->lanes, sizeof *scan->fold);
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

void backproject_scan_destroy(struct backprojection *b)
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
        s->readings[i].trace = backprojection_sample(b, pair, 0);
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
        out[x] = backprojection_intensity(b, depth_m, w->sum[0][at], w->sum[1][at],
                                          w->sum[2][at]);
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
    size_t pairs = backprojection_pairs(b);
    for (size_t t = 0; t < pairs * b->geometry.n_positions; t++)
        scan->fold[t % pairs * b->lanes + t / pairs] = (float)b->stored_fold[t];
}

void backproject_scan(struct backprojection *b)
{
    find_folds(b);
    pool_run(b->pool, tiles_along(b, 1) * tiles_along(b, 2), image_rows, b);
}
