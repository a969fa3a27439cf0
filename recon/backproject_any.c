/* recon/backproject_any.c -- back-projection for any geometry: voxels in the lanes, each
 * looks its delay up in the trace. */
#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/backprojection.h"
#include "recon/phasor.h"

#define BLOCK_ROWS                                                                       \
    12 /* rows of voxels that are summed together: their distances to all                \
          elements of a position stay in the cache */

#define PIECE 256 /* voxels of one pair at once: what lies between stays in the cache */

struct block { /* one a thread, for n voxels */
    size_t n;
    float *position[3];      /* [n] */
    float *delay;            /* [elements][n] in stored samples */
    float *phasor[2];        /* [elements][n] of the carrier over that delay: re, im */
    float *part[2], *sum[2]; /* [n] of one speaker, of all */
};

static int block_create(struct block *s, size_t n, size_t elements)
{
    float **const single[] = {&s->position[0], &s->position[1], &s->position[2],
                              &s->part[0],     &s->part[1],     &s->sum[0],
                              &s->sum[1]};
    float **const each[] = {&s->delay, &s->phasor[0], &s->phasor[1]};
    int err = 0;
    s->n = n;
    for (size_t a = 0; a < sizeof single / sizeof *single; a++)
        if (!(*single[a] = malloc(n * sizeof(float))))
            err = -ENOMEM;
    for (size_t a = 0; a < sizeof each / sizeof *each; a++)
        if (!(*each[a] = malloc(elements * n * sizeof(float))))
            err = -ENOMEM;
    return err;
}

static void block_clear(struct block *s)
{
    for (int a = 0; a < 3; a++)
        free(s->position[a]);
    for (int a = 0; a < 2; a++) {
        free(s->phasor[a]);
        free(s->part[a]);
        free(s->sum[a]);
    }
    free(s->delay);
}

int backproject_any_create(struct backprojection *b)
{
    struct block *blocks = calloc(pool_threads(b->pool), sizeof *blocks);
    if (!blocks)
        return -ENOMEM;
    b->scratch = blocks;
    size_t elements = b->geometry.n_speakers + b->geometry.n_microphones;
    int err = 0;
    for (size_t t = 0; !err && t < pool_threads(b->pool); t++)
        err = block_create(&blocks[t], b->grid.n[0] * BLOCK_ROWS, elements);
    return err;
}

void backproject_any_destroy(struct backprojection *b)
{
    struct block *blocks = b->scratch;
    for (size_t t = 0; blocks && t < pool_threads(b->pool); t++)
        block_clear(&blocks[t]);
    free(blocks);
}

/* Delay in stored samples and carrier phasor from one element to n voxels.  A pair sums
 * two of them, so each carries half of the trace's start. */
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

/* A sample in one load, real and imaginary part: gathering pairs takes half as long as
 * gathering their parts. */
typedef uint64_t sample64 __attribute__((may_alias, aligned(4)));

VECTOR_INLINE float float_of(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

VECTOR_INLINE void split(uint64_t sample, float *re, float *im)
{
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    *re = float_of((uint32_t)sample);
    *im = float_of((uint32_t)(sample >> 32));
#else
    *re = float_of((uint32_t)(sample >> 32));
    *im = float_of((uint32_t)sample);
#endif
}

/* The trace between samples q and q + 1. */
VECTOR_INLINE void between(const sample64 *restrict trace, int q, float f, float *re,
                           float *im)
{
    float ar, ai, br, bi;
    split(trace[q], &ar, &ai);
    split(trace[q + 1], &br, &bi);
    *re = ar + f * (br - ar);
    *im = ai + f * (bi - ai);
}

/* sum += phasor * trace(delay_s + delay_m), linear between stored samples; a trace ends
 * in zeros, and delays outside it are held there. */
VECTOR_CLONES
static void add_pair(const float *restrict trace, float last, size_t n,
                     const float *restrict delay_s, const float *restrict delay_m,
                     const float *restrict re, const float *restrict im,
                     float *restrict sum_re, float *restrict sum_im)
{
    for (size_t v = 0; v < n; v++) {
        float at = delay_s[v] + delay_m[v];
        at = at < 0.0f ? 0.0f : at;
        at = at > last ? last : at;
        int q = (int)at;
        float xr, xi;
        between((const sample64 *)trace, q, at - (float)q, &xr, &xi);
        sum_re[v] += xr * re[v] - xi * im[v];
        sum_im[v] += xr * im[v] + xi * re[v];
    }
}

VECTOR_CLONES
static void add_part(size_t n, const float *restrict re, const float *restrict im,
                     const struct block *s)
{
    for (size_t v = 0; v < n; v++) {
        s->sum[0][v] += s->part[0][v] * re[v] - s->part[1][v] * im[v];
        s->sum[1][v] += s->part[0][v] * im[v] + s->part[1][v] * re[v];
    }
}

/* A ping of one speaker and one microphone: both ways at once, one phasor. */
VECTOR_CLONES
static void pair_delays(const struct backprojection *b, const double speaker[3],
                        const double microphone[3], const struct block *s, size_t first,
                        size_t n, float *restrict delay, float *restrict re,
                        float *restrict im)
{
    float sx = (float)speaker[0], sy = (float)speaker[1], sz = (float)speaker[2];
    float mx = (float)microphone[0], my = (float)microphone[1], mz = (float)microphone[2];
    float per_m = (float)(b->rate_hz / b->geometry.sound_speed_m_s);
    float start = (float)(1.0 - b->in.t0_s * b->rate_hz);
    float turns_per_m = (float)(b->in.carrier_hz / b->geometry.sound_speed_m_s);
    float last = (float)(b->n_stored - 2);
    const float *x = s->position[0] + first, *y = s->position[1] + first;
    const float *z = s->position[2] + first;
    for (size_t v = 0; v < n; v++) {
        float ax = x[v] - sx, ay = y[v] - sy, az = z[v] - sz;
        float bx = x[v] - mx, by = y[v] - my, bz = z[v] - mz;
        float r = sqrtf(ax * ax + ay * ay + az * az) + sqrtf(bx * bx + by * by + bz * bz);
        float at = r * per_m + start;
        at = at < 0.0f ? 0.0f : at;
        delay[v] = at > last ? last : at;
        phasor(r * turns_per_m, &re[v], &im[v]);
    }
}

VECTOR_CLONES
static void add_single(const float *restrict trace, size_t n, const float *restrict delay,
                       const float *restrict re, const float *restrict im,
                       float *restrict sum_re, float *restrict sum_im)
{
    for (size_t v = 0; v < n; v++) {
        int q = (int)delay[v];
        float xr, xi;
        between((const sample64 *)trace, q, delay[v] - (float)q, &xr, &xi);
        sum_re[v] += xr * re[v] - xi * im[v];
        sum_im[v] += xr * im[v] + xi * re[v];
    }
}

static void add_ping(const struct backprojection *b, size_t k, const struct block *s,
                     size_t n)
{
    double speaker[3], microphone[3];
    if (!b->live[k])
        return;
    geometry_speaker(&b->geometry, k, 0, speaker);
    geometry_microphone(&b->geometry, k, 0, microphone);
    for (size_t v = 0; v < n; v += PIECE) {
        size_t m = n - v < PIECE ? n - v : PIECE;
        pair_delays(b, speaker, microphone, s, v, m, s->delay, s->phasor[0],
                    s->phasor[1]);
        add_single(backprojection_sample(b, k, 0, 0), m, s->delay, s->phasor[0],
                   s->phasor[1], s->sum[0] + v, s->sum[1] + v);
    }
}

static void add_position(const struct backprojection *b, size_t k, const struct block *s,
                         size_t n)
{
    if (backprojection_pairs(b) == 1) {
        add_ping(b, k, s, n);
        return;
    }
    size_t n_s = b->geometry.n_speakers, n_m = b->geometry.n_microphones;
    float *re = s->phasor[0], *im = s->phasor[1];
    for (size_t e = 0; e < n_s + n_m; e++) {
        double at[3];
        if (e < n_s)
            geometry_speaker(&b->geometry, k, e, at);
        else
            geometry_microphone(&b->geometry, k, e - n_s, at);
        element_delays(b, at, s, n, s->delay + e * n, re + e * n, im + e * n);
    }
    for (size_t j = 0; j < n_s; j++) {
        memset(s->part[0], 0, n * sizeof(float));
        memset(s->part[1], 0, n * sizeof(float));
        for (size_t i = 0; i < n_m; i++) {
            size_t pair = j * n_m + i, m = n_s + i;
            if (b->live[k * n_s * n_m + pair])
                add_pair(backprojection_sample(b, k, pair, 0), (float)(b->n_stored - 2),
                         n, s->delay + j * n, s->delay + m * n, re + m * n, im + m * n,
                         s->part[0], s->part[1]);
        }
        add_part(n, re + j * n, im + j * n, s);
    }
}

static void image_block(void *ctx, size_t item, size_t thread)
{
    struct backprojection *b = ctx;
    const struct block *s = (const struct block *)b->scratch + thread;
    const struct grid *g = &b->grid;
    size_t first = item * s->n, n = grid_size(g) - first;
    n = n < s->n ? n : s->n;
    for (size_t v = 0; v < n; v++) {
        size_t at[3] = {(first + v) % g->n[0], (first + v) / g->n[0] % g->n[1],
                        (first + v) / (g->n[0] * g->n[1])};
        for (int a = 0; a < 3; a++)
            s->position[a][v] = (float)(g->origin_m[a] + g->step_m[a] * (double)at[a]);
    }
    memset(s->sum[0], 0, n * sizeof(float));
    memset(s->sum[1], 0, n * sizeof(float));
    for (size_t k = 0; k < b->geometry.n_positions; k++)
        add_position(b, k, s, n);
    for (size_t v = 0; v < n; v++)
        b->image[first + v] = backprojection_intensity(
            backprojection_depth_m(b, s->position[0][v], s->position[1][v],
                                   s->position[2][v]),
            s->sum[0][v], s->sum[1][v]);
}

void backproject_any(struct backprojection *b)
{
    size_t size = ((const struct block *)b->scratch)->n;
    pool_run(b->pool, (grid_size(&b->grid) + size - 1) / size, image_block, b);
}
