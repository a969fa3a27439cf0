/* SPDX-License-Identifier: MIT */
#include "recon/coherent/backproject_tile.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/coherent/phasor.h"

static const size_t block_side[3] = {24, 4, 4}, plan_side[3] = {24, 1, 16};

/* A plan view has one plane of height. */
static size_t tiles_along(const struct grid *g, int axis)
{
    size_t side = (g->n[1] == 1 ? plan_side : block_side)[axis];
    return (g->n[axis] + side - 1) / side;
}

size_t tile_count(const struct grid *g)
{
    return tiles_along(g, 0) * tiles_along(g, 1) * tiles_along(g, 2);
}

static void fill_up(struct tile *t)
{
    t->whole = (t->n + VECTOR_LANES - 1) / VECTOR_LANES * VECTOR_LANES;
    for (size_t v = t->n; v < t->whole; v++)
        for (int a = 0; a < 3; a++)
            t->position[a][v] = t->position[a][t->n - 1];
    memset(t->part, 0, sizeof t->part);
    memset(t->sum, 0, sizeof t->sum);
    memset(t->squares, 0, sizeof t->squares);
}

void tile_lay(struct tile *t, const struct grid *g, size_t item)
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
                    t->position[a][n] =
                        (float)(g->origin_m[a] + g->step_m[a] * (double)at[a]);
                t->number[n] = (z * g->n[1] + y) * g->n[0] + x;
            }
        }
    }
    t->n = n;
    fill_up(t);
}

/* -- delays -----------------------------------------------------------------------------
 */

/* sqrt(x), several times as fast as the processor's when many are taken at once, to 3e-7
 * of itself, for x of 0 or 1e-30..1e30: halves the exponent for a guess of 1 / sqrt(x),
 * then Newton's iteration three times.  (Lomont 2003, "Fast inverse square root".) */
VECTOR_INLINE float root(float x)
{
    uint32_t bits;
    float y;
    memcpy(&bits, &x, sizeof bits);
    bits = 0x5f375a86u - (bits >> 1);
    memcpy(&y, &bits, sizeof y);
    float half = 0.5f * x;
    y *= 1.5f - half * y * y;
    y *= 1.5f - half * y * y;
    y *= 1.5f - half * y * y;
    return x * y;
}

void tile_sound(struct tile_sound *s, const struct fine_trace *f, double sound_speed_m_s)
{
    s->per_m = (float)(f->rate_hz / sound_speed_m_s);
    s->turns_per_m = (float)(f->in.carrier_hz / sound_speed_m_s);
    s->half_start = (float)(0.5 * (1.0 - f->in.t0_s * f->rate_hz));
}

VECTOR_CLONES
void tile_path(const struct tile *t, const struct tile_sound *s, const double at[3],
               double more_turns, struct tile_path *restrict out)
{
    float ex = (float)at[0], ey = (float)at[1], ez = (float)at[2];
    float per_m = s->per_m, turns_per_m = s->turns_per_m, start = s->half_start;
    float more = (float)(more_turns - rint(more_turns));
    size_t n = t->whole;
    for (size_t v = 0; v < n; v++) {
        float dx = t->position[0][v] - ex, dy = t->position[1][v] - ey;
        float dz = t->position[2][v] - ez;
        float r = root(dx * dx + dy * dy + dz * dz);
        out->delay[v] = r * per_m + start;
        phasor(r * turns_per_m + more, &out->re[v], &out->im[v]);
    }
}

VECTOR_CLONES
void tile_round_trip(const struct tile *t, const struct tile_sound *s, const double to[3],
                     const double from[3], struct tile_path *restrict out)
{
    float sx = (float)to[0], sy = (float)to[1], sz = (float)to[2];
    float mx = (float)from[0], my = (float)from[1], mz = (float)from[2];
    float per_m = 0.5f * s->per_m, turns_per_m = s->turns_per_m, start = s->half_start;
    size_t n = t->whole;
    for (size_t v = 0; v < n; v++) {
        float x = t->position[0][v], y = t->position[1][v], z = t->position[2][v];
        float ax = x - sx, ay = y - sy, az = z - sz;
        float bx = x - mx, by = y - my, bz = z - mz;
        float r = root(ax * ax + ay * ay + az * az) + root(bx * bx + by * by + bz * bz);
        out->delay[v] = r * per_m + start;
        phasor(r * turns_per_m, &out->re[v], &out->im[v]);
    }
}

/* -- sums -------------------------------------------------------------------------------
 */

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
 * count, += power * |trace|^2.
 * Arrays are parameters, not in structs: only so does the compiler know that they do not
 * overlap. */
VECTOR_INLINE void add_voxels(const struct tile_trace *r, size_t n,
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
static void add_reading(const struct tile_trace *r, size_t n,
                        const uint32_t *restrict trace, const float *restrict to,
                        const float *restrict from, const float *restrict re,
                        const float *restrict im, float *restrict sum_re,
                        float *restrict sum_im)
{
    add_voxels(r, n, trace, to, from, re, im, sum_re, sum_im, NULL, false);
}

VECTOR_CLONES
static void add_reading_squares(const struct tile_trace *r, size_t n,
                                const uint32_t *restrict trace, const float *restrict to,
                                const float *restrict from, const float *restrict re,
                                const float *restrict im, float *restrict sum_re,
                                float *restrict sum_im, float *restrict squares)
{
    add_voxels(r, n, trace, to, from, re, im, sum_re, sum_im, squares, true);
}

void tile_add(const struct tile *t, const struct tile_trace *r,
              const struct tile_path *to, const struct tile_path *from,
              float sum[2][TILE_VOXELS], float *squares)
{
    if (squares)
        add_reading_squares(r, t->whole, r->words, to->delay, from->delay, from->re,
                            from->im, sum[0], sum[1], squares);
    else
        add_reading(r, t->whole, r->words, to->delay, from->delay, from->re, from->im,
                    sum[0], sum[1]);
}

VECTOR_CLONES
void tile_add_part(struct tile *t, const struct tile_path *to)
{
    size_t n = t->whole;
    for (size_t v = 0; v < n; v++) {
        float re = t->part[0][v], im = t->part[1][v];
        t->sum[0][v] += re * to->re[v] - im * to->im[v];
        t->sum[1][v] += re * to->im[v] + im * to->re[v];
        t->part[0][v] = t->part[1][v] = 0.0f;
    }
}

void tile_fetch(const struct tile *t, const struct tile_trace *r,
                const struct tile_path *to, const struct tile_path *from)
{
    const size_t voxels[3] = {0, t->whole / 2, t->whole - 1};
    for (int i = 0; i < 3; i++) {
        float at = to->delay[voxels[i]] + from->delay[voxels[i]];
        if (at >= 0.0f && at < r->last)
            __builtin_prefetch(r->words + (size_t)at);
    }
}
