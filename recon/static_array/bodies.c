/* SPDX-License-Identifier: MIT */
#include "recon/static_array/bodies.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define REACH_M 0.25 /* from one bright place of a body to the next */
#define HALF_M  0.5  /* none of it is farther from its middle */
#define FAINT   0.1f /* of its brightest place: no part of a body */

enum { TOPS = 16 }; /* of one body */

struct bodies {
    struct grid grid;
    float *share;    /* [voxels] of tops: of the body's power, what is left; else 0 */
    uint32_t *tops;  /* [voxels] with a share */
    uint32_t *owner; /* [voxels] the newest top that took it, + 1; 0: none */
    uint32_t *stack; /* [voxels] */
    size_t n_tops;
};

int bodies_create(struct bodies **out, const struct grid *grid)
{
    size_t n = grid_size(grid);
    struct bodies *b = calloc(1, sizeof *b);

    if (!b)
        return -ENOMEM;
    *b = (struct bodies){.grid = *grid,
                         .share = calloc(n, sizeof *b->share),
                         .tops = calloc(n, sizeof *b->tops),
                         .owner = calloc(n, sizeof *b->owner),
                         .stack = calloc(n, sizeof *b->stack)};
    if (!b->share || !b->tops || !b->owner || !b->stack) {
        bodies_destroy(b);
        return -ENOMEM;
    }
    *out = b;
    return 0;
}

void bodies_destroy(struct bodies *b)
{
    if (!b)
        return;
    free(b->share);
    free(b->tops);
    free(b->owner);
    free(b->stack);
    free(b);
}

/* -- where a body is brightest ----------------------------------------------------------
 */

static bool is_top(const struct grid *g, const float *v, size_t voxel)
{
    size_t near[26], n = grid_neighbours(g, voxel, near);

    for (size_t q = 0; q < n; q++)
        if (v[near[q]] > v[voxel])
            return false;
    return true;
}

static size_t climb(const struct grid *g, const float *v, size_t voxel)
{
    size_t near[26], best = voxel;

    do {
        voxel = best;
        size_t n = grid_neighbours(g, voxel, near);
        for (size_t q = 0; q < n; q++)
            if (v[near[q]] > v[best])
                best = near[q];
    } while (best != voxel);
    return best;
}

static void find_box(const struct grid *g, const size_t at[3], size_t low[3],
                     size_t high[3])
{
    for (int a = 0; a < 3; a++) {
        size_t reach = (size_t)fmin(REACH_M / g->step_m[a] + 1e-6, (double)g->n[a]);
        low[a] = at[a] > reach ? at[a] - reach : 0;
        high[a] = at[a] + reach < g->n[a] ? at[a] + reach : g->n[a] - 1;
    }
}

static double distance_m(const struct grid *g, const size_t a[3], const size_t b[3])
{
    double sum = 0.0;

    for (int i = 0; i < 3; i++) {
        double d = ((double)a[i] - (double)b[i]) * g->step_m[i];
        sum += d * d;
    }
    return sqrt(sum);
}

/* The brightest within reach of a voxel that may be of the same body as `from`. */
static size_t brightest(const struct grid *g, const float *v, size_t voxel, size_t from)
{
    size_t at[3], start[3], low[3], high[3], p[3], best = voxel;

    grid_place(g, voxel, at);
    grid_place(g, from, start);
    find_box(g, at, low, high);
    for (p[2] = low[2]; p[2] <= high[2]; p[2]++)
        for (p[1] = low[1]; p[1] <= high[1]; p[1]++)
            for (p[0] = low[0]; p[0] <= high[0]; p[0]++) {
                size_t i = (p[2] * g->n[1] + p[1]) * g->n[0] + p[0];
                if (v[i] > v[best] && distance_m(g, p, start) <= HALF_M)
                    best = i;
            }
    return best;
}

/* From what is left to the brightest place of its body, over all tops on the way. */
static void mark(struct bodies *b, const float *image, float left, size_t from)
{
    size_t way[TOPS], n = 0, at = from, next = from;

    do {
        at = climb(&b->grid, image, next);
        way[n++] = at;
        next = brightest(&b->grid, image, at, from);
    } while (next != at && n < TOPS);
    float share = left / image[at];
    for (size_t i = 0; share >= FAINT && i < n; i++) {
        if (b->share[way[i]] == 0.0f)
            b->tops[b->n_tops++] = (uint32_t)way[i];
        b->share[way[i]] = fmaxf(b->share[way[i]], share);
    }
}

/* -- what belongs to it -----------------------------------------------------------------
 */

static void give(struct bodies *b, size_t voxel, uint32_t number, float value,
                 float *left)
{
    left[voxel] = b->owner[voxel] ? fmaxf(left[voxel], value) : value;
    b->owner[voxel] = number;
}

/* All that is downhill of a top. */
static void fill(struct bodies *b, const float *image, uint32_t number, float *left)
{
    size_t top = b->tops[number - 1], depth = 0, near[26];
    float share = b->share[top], least = FAINT * image[top];

    give(b, top, number, share * image[top], left);
    b->stack[depth++] = (uint32_t)top;
    while (depth) {
        size_t voxel = b->stack[--depth];
        size_t n = grid_neighbours(&b->grid, voxel, near);
        for (size_t q = 0; q < n; q++) {
            float v = image[near[q]];
            if (b->owner[near[q]] == number || v < least || v > image[voxel])
                continue;
            give(b, near[q], number, share * v, left);
            b->stack[depth++] = (uint32_t)near[q];
        }
    }
}

void bodies_restore(struct bodies *b, const float *image, float floor, float *left)
{
    size_t n = grid_size(&b->grid);

    memset(b->share, 0, n * sizeof *b->share);
    memset(b->owner, 0, n * sizeof *b->owner);
    b->n_tops = 0;
    for (size_t v = 0; v < n; v++)
        if (left[v] > floor && is_top(&b->grid, left, v))
            mark(b, image, left[v], v);
    for (size_t i = 0; i < b->n_tops; i++)
        fill(b, image, (uint32_t)i + 1, left);
}
