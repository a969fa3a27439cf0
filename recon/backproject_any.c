/* recon/backproject_any.c -- back-projection for any geometry: voxels in the lanes, each
 * looks its delay up in the trace. */
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/backprojection.h"
#include "recon/phasor.h"
#include "recon/root.h"

/* Voxels of a tile, whole vectors: their distances to the elements of a position stay in
 * the cache, and as they are near each other they read few lines of each trace. */
static const size_t tile_side[3] = {24, 4, 4};
#define VOXELS (24 * 4 * 4)

struct path {                     /* to the voxels */
    float delay[VOXELS];          /* in stored samples */
    float re[VOXELS], im[VOXELS]; /* phasor of the carrier over that delay */
};

struct tile { /* one a thread */
    float position[3][VOXELS];
    size_t number[VOXELS];                 /* in the image */
    float part[2][VOXELS], sum[2][VOXELS]; /* of one speaker, of all */
    float squares[VOXELS];
    struct path *paths; /* [elements], or one of both ways */
};

int backproject_any_create(struct backprojection *b)
{
    struct tile *tiles = calloc(pool_threads(b->pool), sizeof *tiles);
    if (!tiles)
        return -ENOMEM;
    b->scratch = tiles;
    size_t elements = b->geometry.n_speakers + b->geometry.n_microphones;
    for (size_t t = 0; t < pool_threads(b->pool); t++)
        if (!(tiles[t].paths = malloc(elements * sizeof *tiles[t].paths)))
            return -ENOMEM;
    return 0;
}

void backproject_any_destroy(struct backprojection *b)
{
    struct tile *tiles = b->scratch;
    for (size_t t = 0; tiles && t < pool_threads(b->pool); t++)
        free(tiles[t].paths);
    free(tiles);
}

/* -- delays -----------------------------------------------------------------------------
 */

/* A way there and a way back are summed, so each carries half of the trace's start. */
static float half_start(const struct backprojection *b)
{
    return (float)(0.5 * (1.0 - b->in.t0_s * b->rate_hz));
}

VECTOR_CLONES
static void find_path(const struct backprojection *b, const double at[3],
                      const struct tile *tile, size_t n, struct path *restrict out)
{
    float ex = (float)at[0], ey = (float)at[1], ez = (float)at[2];
    float per_m = (float)(b->rate_hz / b->geometry.sound_speed_m_s);
    float turns_per_m = (float)(b->in.carrier_hz / b->geometry.sound_speed_m_s);
    float start = half_start(b);
    for (size_t v = 0; v < n; v++) {
        float dx = tile->position[0][v] - ex, dy = tile->position[1][v] - ey;
        float dz = tile->position[2][v] - ez;
        float r = root(dx * dx + dy * dy + dz * dz);
        out->delay[v] = r * per_m + start;
        phasor(r * turns_per_m, &out->re[v], &out->im[v]);
    }
}

/* There and back at once; half of the delay. */
VECTOR_CLONES
static void find_round_trip(const struct backprojection *b, const double to[3],
                            const double from[3], const struct tile *tile, size_t n,
                            struct path *restrict out)
{
    float sx = (float)to[0], sy = (float)to[1], sz = (float)to[2];
    float mx = (float)from[0], my = (float)from[1], mz = (float)from[2];
    float per_m = (float)(0.5 * b->rate_hz / b->geometry.sound_speed_m_s);
    float turns_per_m = (float)(b->in.carrier_hz / b->geometry.sound_speed_m_s);
    float start = half_start(b);
    for (size_t v = 0; v < n; v++) {
        float x = tile->position[0][v], y = tile->position[1][v];
        float z = tile->position[2][v];
        float ax = x - sx, ay = y - sy, az = z - sz;
        float bx = x - mx, by = y - my, bz = z - mz;
        float r = root(ax * ax + ay * ay + az * az) + root(bx * bx + by * by + bz * bz);
        out->delay[v] = r * per_m + start;
        phasor(r * turns_per_m, &out->re[v], &out->im[v]);
    }
}

/* -- sums -------------------------------------------------------------------------------
 */

struct reading { /* of one trace */
    float last;  /* delays beyond are held here: a trace ends in zeros */
    float scale; /* its unit over its fold */
    float power; /* the same of its power */
};

/* Two samples in one load: a gather takes as long as its loads. */
typedef uint64_t two_samples __attribute__((may_alias, aligned(4)));

/* The trace between samples q and q + 1, in its units. */
VECTOR_INLINE void between(const uint32_t *restrict trace, int q, float f, float *re,
                           float *im)
{
    uint64_t two = *(const two_samples *)(trace + q);
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    int32_t a = (int32_t)(uint32_t)two, b = (int32_t)(uint32_t)(two >> 32);
#else
    int32_t a = (int32_t)(uint32_t)(two >> 32), b = (int32_t)(uint32_t)two;
#endif
    int32_t ar = a >> 16, br = b >> 16;
    int32_t ai = (int32_t)((uint32_t)a << 16) >> 16;
    int32_t bi = (int32_t)((uint32_t)b << 16) >> 16;
    *re = (float)ar + f * (float)(br - ar);
    *im = (float)ai + f * (float)(bi - ai);
}

/* sum += scale * phasor * trace(delay), linear between stored samples; squares, if they
 * count, += power * |trace|^2.  Arrays are parameters, not in structs: only so does the
 * compiler know that they do not overlap. */
VECTOR_INLINE void add_voxels(const struct reading *r, size_t n,
                              const uint32_t *restrict trace, const float *restrict to,
                              const float *restrict from, const float *restrict re,
                              const float *restrict im, float *restrict sum_re,
                              float *restrict sum_im, float *restrict squares,
                              bool with_squares)
{
    float last = r->last, scale = r->scale, power = r->power;
    for (size_t v = 0; v < n; v++) {
        float at = to[v] + from[v], xr, xi;
        at = at < 0.0f ? 0.0f : at;
        at = at > last ? last : at;
        int q = (int)at;
        between(trace, q, at - (float)q, &xr, &xi);
        if (with_squares)
            squares[v] += power * (xr * xr + xi * xi);
        xr *= scale;
        xi *= scale;
        sum_re[v] += xr * re[v] - xi * im[v];
        sum_im[v] += xr * im[v] + xi * re[v];
    }
}

VECTOR_CLONES
static void add_reading(const struct reading *r, size_t n, const uint32_t *restrict trace,
                        const float *restrict to, const float *restrict from,
                        const float *restrict re, const float *restrict im,
                        float *restrict sum_re, float *restrict sum_im)
{
    add_voxels(r, n, trace, to, from, re, im, sum_re, sum_im, NULL, false);
}

VECTOR_CLONES
static void add_reading_squares(const struct reading *r, size_t n,
                                const uint32_t *restrict trace, const float *restrict to,
                                const float *restrict from, const float *restrict re,
                                const float *restrict im, float *restrict sum_re,
                                float *restrict sum_im, float *restrict squares)
{
    add_voxels(r, n, trace, to, from, re, im, sum_re, sum_im, squares, true);
}

/* phasor is that of `from`, or of both ways. */
static void add_trace(const struct backprojection *b, size_t t, size_t n,
                      const struct path *to, const struct path *from, float *sum_re,
                      float *sum_im, float *squares)
{
    if (!b->stored_fold[t])
        return;
    const uint32_t *trace = b->words + t * b->n_stored;
    struct reading r = {.last = (float)(b->n_stored - 2),
                        .scale = b->unit[t] / (float)b->stored_fold[t]};
    r.power = r.scale * b->unit[t];
    if (b->coherence > 0.0f)
        add_reading_squares(&r, n, trace, to->delay, from->delay, from->re, from->im,
                            sum_re, sum_im, squares);
    else
        add_reading(&r, n, trace, to->delay, from->delay, from->re, from->im, sum_re,
                    sum_im);
}

VECTOR_CLONES
static void add_part(size_t n, const struct path *to, struct tile *tile)
{
    for (size_t v = 0; v < n; v++) {
        float re = tile->part[0][v], im = tile->part[1][v];
        tile->sum[0][v] += re * to->re[v] - im * to->im[v];
        tile->sum[1][v] += re * to->im[v] + im * to->re[v];
        tile->part[0][v] = tile->part[1][v] = 0.0f;
    }
}

/* Fetches a trace's samples for the first, the middle and the last voxel: where they lie
 * is nothing the processor could guess. */
static void fetch(const struct backprojection *b, size_t t, size_t n,
                  const struct path *to, const struct path *from)
{
    const size_t voxels[3] = {0, n / 2, n - 1};
    for (int i = 0; i < 3; i++) {
        float at = to->delay[voxels[i]] + from->delay[voxels[i]];
        if (at >= 0.0f && at < (float)b->n_stored)
            __builtin_prefetch(b->words + t * b->n_stored + (size_t)at);
    }
}

static void add_ping(const struct backprojection *b, size_t k, struct tile *tile,
                     size_t n)
{
    double speaker[3], microphone[3];
    geometry_speaker(&b->geometry, k, 0, speaker);
    geometry_microphone(&b->geometry, k, 0, microphone);
    find_round_trip(b, speaker, microphone, tile, n, tile->paths);
    add_trace(b, k, n, tile->paths, tile->paths, tile->sum[0], tile->sum[1],
              tile->squares);
}

static void add_position(const struct backprojection *b, size_t k, struct tile *tile,
                         size_t n)
{
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    for (size_t e = 0; e < n_s + n_m; e++) {
        double at[3];
        if (e < n_s)
            geometry_speaker(&b->geometry, k, e, at);
        else
            geometry_microphone(&b->geometry, k, e - n_s, at);
        find_path(b, at, tile, n, &tile->paths[e]);
    }
    for (size_t j = 0; j < n_s; j++) {
        const struct path *to = &tile->paths[j], *from = &tile->paths[n_s];
        size_t t = (k * n_s + j) * n_m;
        for (size_t i = 0; i < n_m; i++) {
            if (i + 1 < n_m)
                fetch(b, t + i + 1, n, to, from + i + 1);
            add_trace(b, t + i, n, to, from + i, tile->part[0], tile->part[1],
                      tile->squares);
        }
        add_part(n, &tile->paths[j], tile);
    }
}

/* -- tiles ------------------------------------------------------------------------------
 */

static size_t tiles_along(const struct grid *g, int axis)
{
    return (g->n[axis] + tile_side[axis] - 1) / tile_side[axis];
}

/* The voxels of a tile.  Returns how many; whole vectors are filled up with the last. */
static size_t lay_tile(const struct grid *g, size_t item, struct tile *tile)
{
    size_t first[3], end[3], n = 0;
    for (int a = 0; a < 3; a++) {
        size_t along = tiles_along(g, a);
        first[a] = item % along * g->n[a] / along;
        end[a] = (item % along + 1) * g->n[a] / along;
        item /= along;
    }
    for (size_t z = first[2]; z < end[2]; z++) {
        for (size_t y = first[1]; y < end[1]; y++) {
            for (size_t x = first[0]; x < end[0]; x++, n++) {
                const size_t at[3] = {x, y, z};
                for (int a = 0; a < 3; a++)
                    tile->position[a][n] =
                        (float)(g->origin_m[a] + g->step_m[a] * (double)at[a]);
                tile->number[n] = (z * g->n[1] + y) * g->n[0] + x;
            }
        }
    }
    for (size_t v = n; v % VECTOR_LANES; v++)
        for (int a = 0; a < 3; a++)
            tile->position[a][v] = tile->position[a][n - 1];
    return n;
}

static void image_tile(void *ctx, size_t item, size_t thread)
{
    struct backprojection *b = ctx;
    struct tile *tile = (struct tile *)b->scratch + thread;
    size_t n = lay_tile(&b->grid, item, tile);
    size_t whole = (n + VECTOR_LANES - 1) / VECTOR_LANES * VECTOR_LANES;
    memset(tile->part, 0, sizeof tile->part);
    memset(tile->sum, 0, sizeof tile->sum);
    memset(tile->squares, 0, sizeof tile->squares);
    for (size_t k = 0; k < b->geometry.n_positions; k++) {
        if (backprojection_pairs(b) == 1)
            add_ping(b, k, tile, whole);
        else
            add_position(b, k, tile, whole);
    }
    for (size_t v = 0; v < n; v++) {
        float depth_m = backprojection_depth_m(
            b, tile->position[0][v], tile->position[1][v], tile->position[2][v]);
        b->image[tile->number[v]] = backprojection_intensity(
            b, depth_m, tile->sum[0][v], tile->sum[1][v], tile->squares[v]);
    }
}

void backproject_any(struct backprojection *b)
{
    size_t n = 1;
    for (int a = 0; a < 3; a++)
        n *= tiles_along(&b->grid, a);
    pool_run(b->pool, n, image_tile, b);
}
