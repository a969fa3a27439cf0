/* recon/backproject_scan.c -- back-projection for an array that a stage carries along x.
 * The delay of a pair depends on x_voxel - x_stage only, and stage steps are whole
 * voxels: for one difference all stage positions read the same sample, each for its own
 * voxel.  So stage positions lie in the lanes, and nothing is looked up voxel by voxel.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/backprojection.h"
#include "recon/phasor.h"

#define SAME_M 1e-4 /* what a stage position may be off its place */
#define LANES  16
#define ROWS   8 /* depths that are imaged together */

/* Differences summed together: the samples that all pairs need for them, at ROWS depths,
 * stay in the cache. */
#define BLOCK 32

typedef float lanes __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

struct row {          /* what all pairs share for one (y, z): per difference of x */
    float *delay;     /* [elements][n_d] in stored samples */
    float *phasor[2]; /* [elements][n_d] */
    float *sum[2];    /* [stride][n_sum]: voxels of one remainder lie side by side */
};

struct sweep {    /* one a thread */
    size_t n_d;   /* differences */
    size_t n_sum; /* voxels of one remainder, with the lanes' overhang on both sides */
    struct row rows[ROWS];
    int sample[BLOCK];
    float near[2][BLOCK]; /* weight of that sample: re, im */
    float far[2][BLOCK];  /* of the next one */
    float *block;         /* [BLOCK][re, im][lanes]: sums of one block of differences */
};

static size_t n_elements(const struct backprojection *b)
{
    return b->geometry.n_speakers + b->geometry.n_microphones;
}

bool backproject_scan_fits(struct backprojection *b)
{
    const struct geometry *g = &b->geometry;
    if (g->pings_m || g->n_positions < LANES || fabs(g->stage_axis[0] - 1.0) > 1e-9)
        return false;
    double step_m = b->grid.step_m[0];
    double pitch_m =
        (g->stage_positions_m[g->n_positions - 1] - g->stage_positions_m[0]) /
        (double)(g->n_positions - 1);
    double stride = rint(pitch_m / step_m);
    if (stride < 1.0)
        return false;
    for (size_t k = 0; k < g->n_positions; k++) {
        double at = g->stage_positions_m[0] + (double)k * stride * step_m;
        if (fabs(at - g->stage_positions_m[k]) > SAME_M)
            return false;
    }
    b->stride = (size_t)stride;
    b->first_m = g->stage_positions_m[0];
    return true;
}

static int sweep_create(struct sweep *s, const struct backprojection *b)
{
    size_t nx = b->grid.n[0], back = (b->lanes - 1) * b->stride;
    s->n_d = nx + back;
    s->n_sum = (nx + b->stride - 1) / b->stride + 2 * b->lanes + LANES;
    bool ok = (s->block = aligned_alloc(64, BLOCK * 2 * b->lanes * sizeof(float)));
    for (size_t r = 0; r < ROWS; r++) {
        struct row *w = &s->rows[r];
        ok = (w->delay = malloc(n_elements(b) * s->n_d * sizeof(float))) && ok;
        for (int a = 0; a < 2; a++) {
            ok = (w->phasor[a] = malloc(n_elements(b) * s->n_d * sizeof(float))) && ok;
            ok = (w->sum[a] = malloc(b->stride * s->n_sum * sizeof(float))) && ok;
        }
    }
    return ok ? 0 : -ENOMEM;
}

static void sweep_clear(struct sweep *s)
{
    free(s->block);
    for (size_t r = 0; r < ROWS; r++) {
        free(s->rows[r].delay);
        for (int a = 0; a < 2; a++) {
            free(s->rows[r].phasor[a]);
            free(s->rows[r].sum[a]);
        }
    }
}

int backproject_scan_create(struct backprojection *b)
{
    struct sweep *sweeps = calloc(pool_threads(b->pool), sizeof *sweeps);
    if (!sweeps)
        return -ENOMEM;
    b->scratch = sweeps;
    int err = 0;
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++)
        err = sweep_create(&sweeps[t], b);
    return err;
}

void backproject_scan_destroy(struct backprojection *b)
{
    struct sweep *sweeps = b->scratch;
    for (size_t t = 0; sweeps && t < pool_threads(b->pool); t++)
        sweep_clear(&sweeps[t]);
    free(sweeps);
}

/* Difference d stands for x_voxel - x_stage = x0 + (d - back) * step. */
VECTOR_CLONES
static void element_delays(const struct backprojection *b, double x0_m, double beside2_m2,
                           size_t n, float *restrict delay, float *restrict re,
                           float *restrict im)
{
    float per_m = (float)(b->rate_hz / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->in.t0_s * b->rate_hz));
    float turns_per_m = (float)(b->in.carrier_hz / b->geometry.sound_speed_m_s);
    float x0 = (float)x0_m, step = (float)b->grid.step_m[0], beside2 = (float)beside2_m2;
    for (size_t d = 0; d < n; d++) {
        float dx = x0 + step * (float)(int)d;
        float r = sqrtf(dx * dx + beside2);
        delay[d] = r * per_m + start;
        phasor(r * turns_per_m, &re[d], &im[d]);
    }
}

static void row_start(const struct backprojection *b, const struct sweep *s,
                      struct row *w, double y_m, double z_m)
{
    const struct geometry *g = &b->geometry;
    double back_m = (double)((b->lanes - 1) * b->stride) * b->grid.step_m[0];
    for (size_t e = 0; e < n_elements(b); e++) {
        const double *at = e < g->n_speakers ? g->speakers_m[e]
                                             : g->microphones_m[e - g->n_speakers];
        double x0_m = b->grid.origin_m[0] - back_m - b->first_m - at[0];
        double dy = y_m - at[1], dz = z_m - at[2];
        element_delays(b, x0_m, dy * dy + dz * dz, s->n_d, w->delay + e * s->n_d,
                       w->phasor[0] + e * s->n_d, w->phasor[1] + e * s->n_d);
    }
    for (int a = 0; a < 2; a++)
        memset(w->sum[a], 0, b->stride * s->n_sum * sizeof(float));
}

/* Which samples the differences first..first+n-1 read, and with what complex weights. */
VECTOR_CLONES
static void plan_pair(const struct backprojection *b, const struct row *w, size_t speaker,
                      size_t microphone, size_t first, size_t n, struct sweep *s)
{
    size_t e = speaker * s->n_d + first;
    size_t m = (b->geometry.n_speakers + microphone) * s->n_d + first;
    const float *delay_s = w->delay + e, *delay_m = w->delay + m;
    const float *sr = w->phasor[0] + e, *si = w->phasor[1] + e;
    const float *mr = w->phasor[0] + m, *mi = w->phasor[1] + m;
    float last = (float)(b->n_stored - 2);
    for (size_t d = 0; d < n; d++) {
        float at = delay_s[d] + delay_m[d];
        at = at < 0.0f ? 0.0f : at;
        at = at > last ? last : at;
        int sample = (int)at;
        float f = at - (float)sample;
        float re = sr[d] * mr[d] - si[d] * mi[d], im = sr[d] * mi[d] + si[d] * mr[d];
        s->sample[d] = sample;
        s->far[0][d] = f * re;
        s->far[1][d] = f * im;
        s->near[0][d] = re - f * re;
        s->near[1][d] = im - f * im;
    }
}

/* The lanes first..end-1 of difference d fall on voxels inside the image. */
static void lane_range(const struct backprojection *b, size_t d, size_t *first,
                       size_t *end)
{
    long back = (long)((b->lanes - 1) * b->stride), stride = (long)b->stride;
    long voxel = (long)d - back; /* of lane 0 */
    long low = voxel >= 0 ? 0 : (-voxel + stride - 1) / stride;
    long high = ((long)b->grid.n[0] - 1 - voxel) / stride + 1;
    *first = (size_t)low;
    *end = high < (long)b->lanes ? (size_t)high : b->lanes;
}

/* block += what one pair adds to n differences; whole vectors from lane `first` to `end`.
 */
VECTOR_CLONES
static void add_pair(const float *traces, size_t k_lanes, size_t first, size_t end,
                     size_t n, const struct sweep *s)
{
    for (size_t d = 0; d < n; d++) {
        const float *x = traces + (size_t)s->sample[d] * 2 * k_lanes;
        float *sum = s->block + d * 2 * k_lanes;
        float ar = s->near[0][d], ai = s->near[1][d];
        float br = s->far[0][d], bi = s->far[1][d];
        for (size_t k = first; k < end; k += LANES) {
            lanes xr = *(const lanes *)(x + k), xi = *(const lanes *)(x + k_lanes + k);
            lanes yr = *(const lanes *)(x + 2 * k_lanes + k);
            lanes yi = *(const lanes *)(x + 3 * k_lanes + k);
            lanes re = *(lanes *)(sum + k), im = *(lanes *)(sum + k_lanes + k);
            re += ar * xr;
            im += ar * xi;
            re -= ai * xi;
            im += ai * xr;
            re += br * yr;
            im += br * yi;
            re -= bi * yi;
            im += bi * yr;
            *(lanes *)(sum + k) = re;
            *(lanes *)(sum + k_lanes + k) = im;
        }
    }
}

/* Lane k of difference d belongs to voxel d - (lanes - 1) * stride + k * stride. */
static void spread_block(const struct backprojection *b, const struct sweep *s,
                         struct row *w, size_t first, size_t n)
{
    for (size_t d = 0; d < n; d++) {
        size_t low, end;
        lane_range(b, first + d, &low, &end);
        const float *from = s->block + d * 2 * b->lanes;
        size_t voxel = first + d + b->stride;
        size_t at = voxel % b->stride * s->n_sum + voxel / b->stride;
        for (size_t k = low; k < end; k++) {
            w->sum[0][at + k] += from[k];
            w->sum[1][at + k] += from[b->lanes + k];
        }
    }
}

/* All pairs' shares of a block of differences for one row. */
static void sum_block(const struct backprojection *b, struct sweep *s, struct row *w,
                      size_t first, size_t n)
{
    size_t low = b->lanes, high = 0, n_m = b->geometry.n_microphones;
    for (size_t d = 0; d < n; d++) {
        size_t from, end;
        lane_range(b, first + d, &from, &end);
        low = from < low ? from : low;
        high = end > high ? end : high;
    }
    low -= low % LANES;
    memset(s->block, 0, n * 2 * b->lanes * sizeof *s->block);
    for (size_t j = 0; j < b->geometry.n_speakers; j++) {
        for (size_t i = 0; i < n_m; i++) {
            plan_pair(b, w, j, i, first, n, s);
            add_pair(backprojection_sample(b, 0, j * n_m + i, 0), b->lanes, low, high, n,
                     s);
        }
    }
    spread_block(b, s, w, first, n);
}

static void row_finish(const struct backprojection *b, const struct sweep *s,
                       const struct row *w, size_t y, size_t z)
{
    const struct grid *g = &b->grid;
    float depth_m = (float)(g->origin_m[2] + g->step_m[2] * (double)z - b->plane_z_m);
    float *out = b->image + (z * g->n[1] + y) * g->n[0];
    for (size_t x = 0; x < g->n[0]; x++) {
        size_t voxel = x + b->stride * b->lanes;
        size_t at = voxel % b->stride * s->n_sum + voxel / b->stride;
        out[x] = backprojection_intensity(depth_m, w->sum[0][at], w->sum[1][at]);
    }
}

static void image_rows(void *ctx, size_t item, size_t thread)
{
    struct backprojection *b = ctx;
    struct sweep *s = (struct sweep *)b->scratch + thread;
    const struct grid *g = &b->grid;
    size_t y = item % g->n[1], z = item / g->n[1] * ROWS;
    size_t n_rows = g->n[2] - z < ROWS ? g->n[2] - z : ROWS;
    for (size_t r = 0; r < n_rows; r++)
        row_start(b, s, &s->rows[r], g->origin_m[1] + g->step_m[1] * (double)y,
                  g->origin_m[2] + g->step_m[2] * (double)(z + r));
    for (size_t d = 0; d < s->n_d; d += BLOCK)
        for (size_t r = 0; r < n_rows; r++)
            sum_block(b, s, &s->rows[r], d, s->n_d - d < BLOCK ? s->n_d - d : BLOCK);
    for (size_t r = 0; r < n_rows; r++)
        row_finish(b, s, &s->rows[r], y, z + r);
}

void backproject_scan(struct backprojection *b)
{
    size_t slabs = (b->grid.n[2] + ROWS - 1) / ROWS;
    pool_run(b->pool, slabs * b->grid.n[1], image_rows, b);
}
