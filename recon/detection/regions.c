/* SPDX-License-Identifier: MIT */
#include "recon/detection/regions.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"

#define BODY_DB 6.0 /* an object's body: what is this far below its peak */

struct search {
    const struct grid *grid;
    const float *volume;
    double threshold, cluster_m;
    regions_judge judge;
    void *judge_state;
    uint32_t *owner; /* [voxels] region number + 1, 0: none */
    uint32_t *stack; /* [voxels] */
};

static void include(struct search *s, struct region *r, size_t voxel)
{
    size_t at[3];
    grid_place(s->grid, voxel, at);
    double v = s->volume[voxel];
    r->sum += v;
    for (int a = 0; a < 3; a++) {
        r->low[a] = at[a] < r->low[a] ? at[a] : r->low[a];
        r->high[a] = at[a] > r->high[a] ? at[a] : r->high[a];
        r->moment[a] += v * (double)at[a];
    }
    for (int a = 0, e = 0; a < 3; a++)
        for (int b = a; b < 3; b++)
            r->second[e++] += v * (double)(at[a] * at[b]);
}

/* Grows a region around its peak over all free voxels within BODY_DB of it. */
static void grow(struct search *s, struct region *r, uint32_t number)
{
    double limit = fmax(s->threshold, s->volume[r->peak] * pow(10.0, -0.1 * BODY_DB));
    size_t depth = 0;
    s->stack[depth++] = (uint32_t)r->peak;
    s->owner[r->peak] = number;
    while (depth) {
        size_t voxel = s->stack[--depth], near[26];
        include(s, r, voxel);
        size_t n = grid_neighbours(s->grid, voxel, near);
        for (size_t q = 0; q < n; q++) {
            if (!s->owner[near[q]] && s->volume[near[q]] >= limit) {
                s->owner[near[q]] = number;
                s->stack[depth++] = (uint32_t)near[q];
            }
        }
    }
}

/* Of equal ones it is the first. */
static bool yields(const struct search *s, size_t voxel, size_t other)
{
    return s->volume[other] > s->volume[voxel] ||
           (s->volume[other] == s->volume[voxel] && other < voxel);
}

/* Most voxels, of which x is the place in their row, are none by one of the next in it or
 * in depth. */
static bool is_peak(const struct search *s, size_t voxel, size_t x)
{
    size_t near[26], n;
    size_t plane = s->grid->n[0] * s->grid->n[1];
    if ((x && yields(s, voxel, voxel - 1)) ||
        (x + 1 < s->grid->n[0] && yields(s, voxel, voxel + 1)) ||
        (voxel >= plane && yields(s, voxel, voxel - plane)) ||
        (voxel + plane < grid_size(s->grid) && yields(s, voxel, voxel + plane)))
        return false;
    n = grid_neighbours(s->grid, voxel, near);
    for (size_t q = 0; q < n; q++)
        if (yields(s, voxel, near[q]))
            return false;
    return true;
}

struct peak {
    float value;
    uint32_t voxel;
};

static int strongest_first(const void *a, const void *b)
{
    const struct peak *x = a, *y = b;
    if (x->value != y->value)
        return x->value < y->value ? 1 : -1;
    return (x->voxel > y->voxel) - (x->voxel < y->voxel);
}

static int find_peaks(const struct search *s, struct peak **out, size_t *n)
{
    size_t room = 0;
    *out = NULL;
    *n = 0;
    for (size_t v = 0, x = 0; v < grid_size(s->grid); v++, x++) {
        x = x == s->grid->n[0] ? 0 : x;
        if (s->volume[v] < s->threshold || !is_peak(s, v, x) ||
            (s->judge && !s->judge(s->judge_state, v)))
            continue;
        if (list_grow(out, *n, &room, sizeof **out))
            return -ENOMEM;
        (*out)[(*n)++] = (struct peak){s->volume[v], (uint32_t)v};
    }
    if (*n)
        qsort(*out, *n, sizeof **out, strongest_first);
    return 0;
}

/* Gap in m between an object with its halo and a region; 0 when they touch. */
static double gap(const struct grid *g, const struct region *a, const struct region *b)
{
    double sum = 0.0;
    for (int i = 0; i < 3; i++) {
        double d = fmax((double)a->halo_low[i] - (double)b->high[i],
                        (double)b->low[i] - (double)a->halo_high[i]);
        d = fmax(d, 0.0) * g->step_m[i];
        sum += d * d;
    }
    return sqrt(sum);
}

static void widen(size_t low[3], size_t high[3], const struct region *r)
{
    for (int a = 0; a < 3; a++) {
        low[a] = r->low[a] < low[a] ? r->low[a] : low[a];
        high[a] = r->high[a] > high[a] ? r->high[a] : high[a];
    }
}

static void join(struct region *into, const struct region *r)
{
    widen(into->low, into->high, r);
    into->sum += r->sum;
    for (int a = 0; a < 3; a++)
        into->moment[a] += r->moment[a];
    for (int e = 0; e < 6; e++)
        into->second[e] += r->second[e];
}

/* A fainter neighbour is the smear around an object, not a part of its body. */
static bool belongs(const struct search *s, const struct region *to,
                    const struct region *r)
{
    return s->volume[r->peak] >= s->volume[to->peak] * pow(10.0, -0.1 * BODY_DB);
}

/* The stronger object that a region belongs to; NULL: it is one of its own. */
static struct region *owner_of(const struct search *s, struct regions *found,
                               const struct region *r)
{
    for (size_t near = 0; near < found->n; near++)
        if (gap(s->grid, &found->at[near], r) <= s->cluster_m)
            return &found->at[near];
    return NULL;
}

static void take(struct search *s, struct regions *found, size_t peak)
{
    struct region r = {.peak = peak, .low = {SIZE_MAX, SIZE_MAX, SIZE_MAX}};
    grow(s, &r, (uint32_t)found->n + 1);
    struct region *owner = owner_of(s, found, &r);
    if (!owner) {
        memcpy(r.halo_low, r.low, sizeof r.low);
        memcpy(r.halo_high, r.high, sizeof r.high);
        found->at[found->n++] = r;
        return;
    }
    widen(owner->halo_low, owner->halo_high, &r);
    if (belongs(s, owner, &r))
        join(owner, &r);
}

int regions_find(struct regions *out, const struct grid *grid, const float *intensity,
                 double threshold, double cluster_m, regions_judge judge, void *state)
{
    size_t voxels = grid_size(grid), n = 0;
    struct search s = {.grid = grid,
                       .volume = intensity,
                       .threshold = threshold,
                       .cluster_m = cluster_m,
                       .judge = judge,
                       .judge_state = state};
    struct peak *peaks = NULL;
    memset(out, 0, sizeof *out);
    s.owner = calloc(voxels, sizeof *s.owner);
    s.stack = malloc(voxels * sizeof *s.stack);
    int err = s.owner && s.stack ? find_peaks(&s, &peaks, &n) : -ENOMEM;
    if (!err && n) {
        out->at = calloc(n, sizeof *out->at);
        err = out->at ? 0 : -ENOMEM;
    }
    for (size_t p = 0; !err && p < n; p++)
        if (!s.owner[peaks[p].voxel])
            take(&s, out, peaks[p].voxel);
    free(peaks);
    free(s.owner);
    free(s.stack);
    return err;
}

void regions_clear(struct regions *r)
{
    free(r->at);
    memset(r, 0, sizeof *r);
}
