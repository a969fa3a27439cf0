/* SPDX-License-Identifier: MIT */
/* recon/power/incoherent_scan.c -- back-projection of power for an array that a stage
 * carries along x: see recon/coherent/backproject_scan.c for why stage positions lie in
 * the lanes.  Power needs no phases, so that one sum a lane passes all pairs without
 * leaving its register.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/power/incoherent.h"

#define ROWS     8  /* depths that are imaged together */
#define BLOCK    16 /* differences that are planned together */
#define TOGETHER 4  /* differences summed together */

struct sweep {     /* one a thread */
    size_t n_d;    /* differences of x between voxel and stage */
    size_t n_sum;  /* voxels of one remainder, with the lanes' overhang on both sides */
    float *delay;  /* [ROWS][elements][n_d] in stored samples */
    float *sum;    /* [ROWS][stride][n_sum]: voxels of one remainder lie side by side */
    int *sample;   /* [pairs][BLOCK]: which samples a block reads */
    float *beyond; /* [pairs][BLOCK]: and how far past them */
};

static size_t n_elements(const struct incoherent *b)
{
    return b->geometry.n_speakers + b->geometry.n_microphones;
}

bool incoherent_scan_fits(const struct incoherent *b, struct incoherent_slab *slab)
{
    slab->stride = geometry_stage_stride(&b->geometry, slab->grid.step_m[0]);
    return slab->stride && b->geometry.n_positions >= VECTOR_LANES;
}

static size_t differences(const struct incoherent *b, const struct incoherent_slab *slab)
{
    return slab->grid.n[0] + (b->lanes - 1) * slab->stride;
}

/* Voxels of one remainder, with the lanes' overhang on both sides. */
static size_t sums(const struct incoherent *b, const struct incoherent_slab *slab)
{
    return (slab->grid.n[0] + slab->stride - 1) / slab->stride + 2 * b->lanes +
           VECTOR_LANES;
}

static int sweep_create(struct sweep *s, const struct incoherent *b)
{
    size_t n_d = 0, n_sum = 0;
    for (size_t i = 0; i < b->n_slabs; i++) {
        size_t d = differences(b, &b->slabs[i]);
        size_t n = sums(b, &b->slabs[i]) * b->slabs[i].stride;
        n_d = d > n_d ? d : n_d;
        n_sum = n > n_sum ? n : n_sum;
    }
    s->delay = malloc(ROWS * n_elements(b) * n_d * sizeof *s->delay);
    s->sum = malloc(ROWS * n_sum * sizeof *s->sum);
    s->sample = calloc(incoherent_pairs(b) * BLOCK, sizeof *s->sample);
    s->beyond = calloc(incoherent_pairs(b) * BLOCK, sizeof *s->beyond);
    return s->delay && s->sum && s->sample && s->beyond ? 0 : -ENOMEM;
}

int incoherent_scan_create(struct incoherent *b)
{
    struct sweep *sweeps = calloc(pool_threads(b->pool), sizeof *sweeps);
    if (!sweeps)
        return -ENOMEM;
    b->sweeps = sweeps;
    int err = 0;
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++)
        err = sweep_create(&sweeps[t], b);
    return err;
}

void incoherent_scan_destroy(struct incoherent *b)
{
    struct sweep *sweeps = b->sweeps;
    for (size_t t = 0; sweeps && t < pool_threads(b->pool); t++) {
        free(sweeps[t].delay);
        free(sweeps[t].sum);
        free(sweeps[t].sample);
        free(sweeps[t].beyond);
    }
    free(sweeps);
}

/* Difference d stands for x_voxel - x_stage = x0 + d * step. */
VECTOR_CLONES
static void element_delays(const struct incoherent *b, double x0_m, double beside2_m2,
                           size_t n, float *restrict delay)
{
    float per_m = (float)(incoherent_rate_hz(b) / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->in.t0_s * incoherent_rate_hz(b)));
    float x0 = (float)x0_m, step = (float)b->slab->grid.step_m[0],
          beside2 = (float)beside2_m2;
    for (size_t d = 0; d < n; d++) {
        float dx = x0 + step * (float)(int)d;
        delay[d] = start + per_m * sqrtf(dx * dx + beside2);
    }
}

static void row_start(const struct incoherent *b, const struct sweep *s, size_t row,
                      double y_m, double z_m)
{
    const struct geometry *g = &b->geometry;
    double back_m = (double)((b->lanes - 1) * b->slab->stride) * b->slab->grid.step_m[0];
    for (size_t e = 0; e < n_elements(b); e++) {
        const double *at = e < g->n_speakers ? g->speakers_m[e]
                                             : g->microphones_m[e - g->n_speakers];
        double x0_m = b->slab->grid.origin_m[0] - back_m -
                      b->geometry.stage_positions_m[0] - at[0];
        double dy = y_m - at[1], dz = z_m - at[2];
        element_delays(b, x0_m, dy * dy + dz * dz, s->n_d,
                       s->delay + (row * n_elements(b) + e) * s->n_d);
    }
    memset(s->sum + row * b->slab->stride * s->n_sum, 0,
           b->slab->stride * s->n_sum * sizeof *s->sum);
}

/* Which samples all pairs read for the differences first..first + n - 1. */
VECTOR_CLONES
static void plan_block(const struct incoherent *b, const float *delay, size_t n_d,
                       size_t first, size_t n, int *restrict sample,
                       float *restrict beyond)
{
    size_t n_m = b->geometry.n_microphones;
    float last = (float)(b->n_stored - 2);
    for (size_t pair = 0; pair < incoherent_pairs(b); pair++) {
        const float *s = delay + pair / n_m * n_d + first;
        const float *m = delay + (b->geometry.n_speakers + pair % n_m) * n_d + first;
        for (size_t d = 0; d < n; d++) {
            float at = s[d] + m[d];
            at = at > 0.0f ? at : 0.0f;
            at = at < last ? at : last;
            int whole = (int)at;
            sample[pair * BLOCK + d] = whole;
            beyond[pair * BLOCK + d] = at - (float)whole;
        }
    }
}

/* Stage positions whose voxel for difference d lies on the grid: first..end-1. */
static void lane_range(const struct incoherent *b, size_t d, size_t *first, size_t *end)
{
    long back = (long)((b->lanes - 1) * b->slab->stride), stride = (long)b->slab->stride;
    long voxel = (long)d - back; /* of lane 0 */
    long low = voxel >= 0 ? 0 : (-voxel + stride - 1) / stride;
    long high = ((long)b->slab->grid.n[0] - 1 - voxel) / stride + 1;
    *first = (size_t)low;
    *end = high < (long)b->lanes ? (size_t)high : b->lanes;
}

/* sum [TOGETHER][16]: of 16 lanes over all pairs, for neighbouring differences, which
 * read neighbouring samples. */
VECTOR_CLONES
static void sum_pairs(const struct incoherent *b, const float *stored, const int *sample,
                      const float *beyond, float *restrict sum)
{
    size_t pairs = incoherent_pairs(b), pitch = b->n_stored * b->lanes;
    float part[TOGETHER][VECTOR_LANES] = {{0}};
    for (size_t pair = 0; pair < pairs; pair++, stored += pitch) {
#pragma GCC unroll 4 /* all TOGETHER: their sums become registers */
        for (size_t d = 0; d < TOGETHER; d++) {
            const float *x = stored + (size_t)sample[pair * BLOCK + d] * b->lanes;
            float f = beyond[pair * BLOCK + d];
            for (size_t v = 0; v < VECTOR_LANES; v++) {
                part[d][v] += (1.0f - f) * x[v];
                part[d][v] += f * x[b->lanes + v];
            }
        }
    }
    memcpy(sum, part, sizeof part);
}

/* Lane k of difference d belongs to voxel d - (lanes - 1) * stride + k * stride. */
static void sum_block(const struct incoherent *b, struct sweep *s, size_t row,
                      size_t first, size_t n)
{
    float *rows = s->sum + row * b->slab->stride * s->n_sum,
          part[TOGETHER * VECTOR_LANES];
    plan_block(b, s->delay + row * n_elements(b) * s->n_d, s->n_d, first, n, s->sample,
               s->beyond);
    for (size_t d = 0; d < n; d += TOGETHER) {
        size_t together = n - d < TOGETHER ? n - d : TOGETHER, low = b->lanes, high = 0;
        for (size_t e = 0; e < together; e++) {
            size_t from, end;
            lane_range(b, first + d + e, &from, &end);
            low = from < low ? from : low;
            high = end > high ? end : high;
        }
        for (size_t k = low - low % VECTOR_LANES; k < high; k += VECTOR_LANES) {
            sum_pairs(b, b->stored + k, s->sample + d, s->beyond + d, part);
            for (size_t e = 0; e < together; e++) {
                size_t voxel = first + d + e + b->slab->stride;
                float *to = rows + voxel % b->slab->stride * s->n_sum +
                            voxel / b->slab->stride + k;
                for (size_t l = 0; l < VECTOR_LANES; l++)
                    to[l] += part[e * VECTOR_LANES + l];
            }
        }
    }
}

static void row_finish(const struct incoherent *b, const struct sweep *s, size_t row,
                       size_t y, size_t z)
{
    const struct grid *g = &b->slab->grid;
    const float *sum = s->sum + row * b->slab->stride * s->n_sum;
    float *out = b->image + (z * g->n[1] + y) * g->n[0];
    for (size_t x = 0; x < g->n[0]; x++) {
        size_t voxel = x + b->slab->stride * b->lanes;
        out[x] = sum[voxel % b->slab->stride * s->n_sum + voxel / b->slab->stride];
    }
}

static void image_rows(void *ctx, size_t item, size_t thread)
{
    struct incoherent *b = ctx;
    struct sweep *s = (struct sweep *)b->sweeps + thread;
    const struct grid *g = &b->slab->grid;
    size_t y = item % g->n[1], z = item / g->n[1] * ROWS;
    size_t n_rows = g->n[2] - z < ROWS ? g->n[2] - z : ROWS;
    s->n_d = differences(b, b->slab);
    s->n_sum = sums(b, b->slab);
    for (size_t r = 0; r < n_rows; r++)
        row_start(b, s, r, g->origin_m[1] + g->step_m[1] * (double)y,
                  g->origin_m[2] + g->step_m[2] * (double)(z + r));
    for (size_t d = 0; d < s->n_d; d += BLOCK)
        for (size_t r = 0; r < n_rows; r++)
            sum_block(b, s, r, d, s->n_d - d < BLOCK ? s->n_d - d : BLOCK);
    for (size_t r = 0; r < n_rows; r++)
        row_finish(b, s, r, y, z + r);
}

void incoherent_scan(struct incoherent *b)
{
    size_t slabs = (b->slab->grid.n[2] + ROWS - 1) / ROWS;
    pool_run(b->pool, slabs * b->slab->grid.n[1], image_rows, b);
}
