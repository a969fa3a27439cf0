/* recon/power/incoherent_any.c -- back-projection of power for any geometry: voxels in
 * the lanes, each looks its delay up in the trace. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/vector.h"
#include "recon/power/incoherent.h"

#define BLOCK 256 /* voxels: their delays to all elements stay in the cache */

struct sweep {             /* one a thread */
    float voxel[3][BLOCK]; /* m */
    float sum[BLOCK];
    float *delay; /* [elements][BLOCK] in stored samples */
};

static size_t n_elements(const struct incoherent *b)
{
    return b->geometry.n_speakers + b->geometry.n_microphones;
}

int incoherent_any_create(struct incoherent *b)
{
    struct sweep *sweeps = calloc(pool_threads(b->pool), sizeof *sweeps);
    b->sweeps = sweeps;
    for (size_t t = 0; sweeps && t < pool_threads(b->pool); t++)
        if (!(sweeps[t].delay = malloc(n_elements(b) * BLOCK * sizeof(float))))
            return -ENOMEM;
    return sweeps ? 0 : -ENOMEM;
}

void incoherent_any_destroy(struct incoherent *b)
{
    struct sweep *sweeps = b->sweeps;
    for (size_t t = 0; sweeps && t < pool_threads(b->pool); t++)
        free(sweeps[t].delay);
    free(sweeps);
}

/* Half of the origin of time goes to each of a pair's two elements. */
VECTOR_CLONES
static void element_delays(const struct incoherent *b, const double at[3],
                           const float (*restrict voxel)[BLOCK], float *restrict delay)
{
    float per_m = (float)(incoherent_rate_hz(b) / b->geometry.sound_speed_m_s);
    float start = (float)(0.5 * (1.0 - b->in.t0_s * incoherent_rate_hz(b)));
    float x = (float)at[0], y = (float)at[1], z = (float)at[2];
    for (size_t v = 0; v < BLOCK; v++) {
        float dx = voxel[0][v] - x, dy = voxel[1][v] - y, dz = voxel[2][v] - z;
        delay[v] = start + per_m * sqrtf(dx * dx + dy * dy + dz * dz);
    }
}

VECTOR_CLONES
static void add_trace(const float *restrict trace, float last, const float *restrict a,
                      const float *restrict b, float *restrict sum)
{
    for (size_t v = 0; v < BLOCK; v++) {
        float at = a[v] + b[v];
        at = at > 0.0f ? at : 0.0f;
        at = at < last ? at : last;
        int sample = (int)at;
        float x = trace[sample], y = trace[sample + 1];
        sum[v] += x + (at - (float)sample) * (y - x);
    }
}

/* Adds all traces of one position. */
static void add_position(const struct incoherent *b, struct sweep *s, size_t k)
{
    const struct geometry *g = &b->geometry;
    float last = (float)(b->n_stored - 2);
    for (size_t e = 0; e < n_elements(b); e++) {
        double at[3];
        if (e < g->n_speakers)
            geometry_speaker(g, k, e, at);
        else
            geometry_microphone(g, k, e - g->n_speakers, at);
        element_delays(b, at, s->voxel, s->delay + e * BLOCK);
    }
    for (size_t pair = 0; pair < incoherent_pairs(b); pair++) {
        size_t trace = k * incoherent_pairs(b) + pair;
        if (b->live[trace])
            add_trace(b->stored + trace * b->n_stored, last,
                      s->delay + pair / g->n_microphones * BLOCK,
                      s->delay + (g->n_speakers + pair % g->n_microphones) * BLOCK,
                      s->sum);
    }
}

static void image_block(void *ctx, size_t item, size_t thread)
{
    struct incoherent *b = ctx;
    struct sweep *s = (struct sweep *)b->sweeps + thread;
    const struct grid *g = &b->slab->grid;
    size_t first = item * BLOCK, all = grid_size(g);
    size_t n = all - first < BLOCK ? all - first : BLOCK;
    for (size_t v = 0; v < BLOCK; v++) {
        size_t at[3];
        grid_place(g, first + (v < n ? v : n - 1), at);
        for (int a = 0; a < 3; a++)
            s->voxel[a][v] = (float)(g->origin_m[a] + g->step_m[a] * (double)at[a]);
        s->sum[v] = 0.0f;
    }
    for (size_t k = 0; k < b->geometry.n_positions; k++)
        add_position(b, s, k);
    for (size_t v = 0; v < n; v++)
        b->image[first + v] = s->sum[v];
}

void incoherent_any(struct incoherent *b)
{
    pool_run(b->pool, (grid_size(&b->slab->grid) + BLOCK - 1) / BLOCK, image_block, b);
}
