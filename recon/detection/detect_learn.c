/* SPDX-License-Identifier: MIT */
#include "recon/detection/detect_learn.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#define BIN_M      0.05
#define LEAST_LEFT 0.1 /* of what is imaged */
#define FAR_ABOVE  8.0 /* times the brightest of what is left */

enum {
    BINS = 1024,
    OBJECTS = 3,
    RING = 7 /* bins, 0.35 m from the middle of an object: its depth, height and smear */
};

struct rings {
    float most[BINS]; /* of each range */
    bool left_out[BINS];
};

static size_t bin_of(const struct grid *g, size_t voxel)
{
    double x = g->origin_m[0] + g->step_m[0] * (double)(voxel % g->n[0]);
    double y = g->origin_m[1] + g->step_m[1] * (double)(voxel / g->n[0] % g->n[1]);
    double z = g->origin_m[2] + g->step_m[2] * (double)(voxel / (g->n[0] * g->n[1]));
    double at = sqrt(x * x + y * y + z * z) / BIN_M;

    return at < BINS ? (size_t)at : BINS - 1;
}

static size_t brightest(const struct rings *r)
{
    size_t best = BINS;

    for (size_t b = 0; b < BINS; b++)
        if (!r->left_out[b] && r->most[b] > (best < BINS ? r->most[best] : 0.0f))
            best = b;
    return best;
}

static void leave_out(struct rings *r, size_t middle)
{
    for (size_t b = middle > RING ? middle - RING : 0; b <= middle + RING; b++)
        if (b < BINS)
            r->left_out[b] = true;
}

/* true: there are objects, and their rings are left out.  A ring that leaves nothing to
 * compare with may be an object's; several that are alike are clutter, in a narrow gate
 * too. */
static bool find_objects(struct rings *r)
{
    for (int i = 0; i < OBJECTS; i++) {
        size_t object = brightest(r);
        if (object == BINS)
            return false;
        leave_out(r, object);
        size_t next = brightest(r);
        if (next == BINS)
            return i == 0;
        if ((double)r->most[object] > FAR_ABOVE * (double)r->most[next])
            return true;
    }
    return false;
}

int detect_learn(struct cfar *c, const struct grid *grid, const float *intensity,
                 const bool *known)
{
    size_t n = grid_size(grid), n_imaged = 0, n_rest = 0;
    struct rings r = {.most = {0.0f}};
    float *rest = malloc(n * sizeof *rest);

    if (!rest)
        return -ENOMEM;
    for (size_t v = 0; v < n; v++) {
        size_t b = bin_of(grid, v);
        rest[v] = known && known[v] ? 0.0f : intensity[v];
        r.most[b] = fmaxf(r.most[b], rest[v]);
        n_imaged += intensity[v] > 0.0f;
    }
    bool objects = find_objects(&r);
    for (size_t v = 0; v < n; v++) {
        if (objects && r.left_out[bin_of(grid, v)])
            rest[v] = 0.0f;
        n_rest += rest[v] > 0.0f;
    }
    if ((double)n_rest >= LEAST_LEFT * (double)n_imaged)
        cfar_learn(c, rest);
    else if (!cfar_has_learnt(c)) /* better than nothing */
        cfar_learn(c, intensity);
    free(rest);
    return 0;
}
