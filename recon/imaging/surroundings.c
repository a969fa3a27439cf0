/* SPDX-License-Identifier: MIT */
#include "recon/imaging/surroundings.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/coarse.h"

#define ASIDE 0.35 /* of the range */
#define ALONG 0.25 /* m */
#define MOST  1e7  /* voxels */

struct surroundings {
    struct grid volume; /* that is wanted */
    struct imager *imager;
    struct grid around;
    float *all;      /* [nz][ny][nx] of that */
    size_t first[3]; /* the voxel of it where the view's grid begins */
    float *inside;   /* [nz][ny][nx] of that */
    float spots[SURROUNDINGS_SPOTS][4];
    struct surroundings_view view;
};

static double far_m(const struct grid *g, int axis)
{
    return g->origin_m[axis] + g->step_m[axis] * (double)(g->n[axis] - 1);
}

static bool fits(const struct grid *g)
{
    return (double)g->n[0] * (double)g->n[1] * (double)g->n[2] <= MOST;
}

/* The volume's grid, continued on all sides but those of a plane.  false: it would have
 * more steps along an axis than the coarse one may have voxels. */
static bool widen(struct grid *g)
{
    double near = g->origin_m[2], far = far_m(g, 2);

    for (int a = 0; a < 3; a++) {
        if (g->n[a] == 1)
            continue;
        double after_m = a < 2 ? ASIDE * fabs(far) : ALONG;
        double before_m = a < 2 ? after_m : fmin(ALONG, fmax(0.5 * near, 0.0));
        double before = ceil(before_m / g->step_m[a]);
        double more = before + ceil(after_m / g->step_m[a]);
        if (!(more <= MOST))
            return false;
        g->origin_m[a] -= before * g->step_m[a];
        g->n[a] += (size_t)more;
    }
    return true;
}

/* The coarse voxels from the last before the volume to the first behind it. */
static void cut(struct surroundings *s)
{
    const struct grid *g = &s->around;
    struct grid *in = &s->view.grid;

    *in = *g;
    for (int a = 0; a < 3; a++) {
        double begin = (s->volume.origin_m[a] - g->origin_m[a]) / g->step_m[a];
        double end = (far_m(&s->volume, a) - g->origin_m[a]) / g->step_m[a];
        double last = fmin(ceil(end), (double)(g->n[a] - 1));
        s->first[a] = (size_t)fmin(fmax(floor(begin), 0.0), last);
        in->origin_m[a] += g->step_m[a] * (double)s->first[a];
        in->n[a] = (size_t)last - s->first[a] + 1;
    }
}

static int allocate(struct surroundings *s)
{
    s->all = calloc(grid_size(&s->around), sizeof *s->all);
    s->inside = calloc(grid_size(&s->view.grid), sizeof *s->inside);
    s->view.intensity = s->inside;
    s->view.spots = (const float(*)[4])s->spots;
    return s->all && s->inside ? 0 : -ENOMEM;
}

int surroundings_create(struct surroundings **out, const struct imager_config *wanted)
{
    struct imager_config wide = *wanted, look;
    struct surroundings *s;

    if (wanted->geometry->pings_m)
        return -ENOTSUP;
    if (!widen(&wide.grid))
        return -ENOTSUP;
    coarse_view(&wide, &look);
    if (!fits(&look.grid))
        return -ENOTSUP;
    s = calloc(1, sizeof *s);
    if (!s)
        return -ENOMEM;
    s->volume = wanted->grid;
    s->around = look.grid;
    cut(s);
    int err = coarse_create(&s->imager, &look);
    if (!err)
        err = allocate(s);
    if (err) {
        surroundings_destroy(s);
        return err;
    }
    *out = s;
    return 0;
}

struct imager *surroundings_imager(struct surroundings *s)
{
    return s->imager;
}

static void crop(struct surroundings *s)
{
    const struct grid *g = &s->around, *in = &s->view.grid;
    float *out = s->inside;

    for (size_t z = 0; z < in->n[2]; z++)
        for (size_t y = 0; y < in->n[1]; y++) {
            size_t row = (z + s->first[2]) * g->n[1] + y + s->first[1];
            for (size_t x = 0; x < in->n[0]; x++)
                *out++ = s->all[row * g->n[0] + x + s->first[0]];
        }
}

static bool is_brightest_around(const struct surroundings *s, size_t voxel)
{
    size_t near[26], n = grid_neighbours(&s->around, voxel, near);

    for (size_t q = 0; q < n; q++)
        if (s->all[near[q]] > s->all[voxel])
            return false;
    return true;
}

/* Where a voxel is; false: in the volume. */
static bool is_outside(const struct surroundings *s, size_t voxel, float at_m[3])
{
    const struct grid *g = &s->around;
    bool outside = false;
    size_t at[3];

    grid_place(g, voxel, at);
    for (int a = 0; a < 3; a++) {
        double p_m = g->origin_m[a] + g->step_m[a] * (double)at[a];
        outside |= p_m < s->volume.origin_m[a] || p_m > far_m(&s->volume, a);
        at_m[a] = (float)p_m;
    }
    return outside;
}

static void keep(struct surroundings *s, const float spot[4])
{
    size_t i = s->view.n_spots;

    s->view.n_spots += i < SURROUNDINGS_SPOTS;
    i -= i == SURROUNDINGS_SPOTS; /* the faintest makes room */
    for (; i && s->spots[i - 1][3] < spot[3]; i--)
        memcpy(s->spots[i], s->spots[i - 1], sizeof s->spots[i]);
    memcpy(s->spots[i], spot, sizeof s->spots[i]);
}

const struct surroundings_view *surroundings_image(struct surroundings *s)
{
    float *faintest = &s->spots[SURROUNDINGS_SPOTS - 1][3];

    if (imager_image(s->imager, s->all))
        return NULL;
    crop(s);
    s->view.n_spots = 0;
    *faintest = 0.0f;
    for (size_t v = 0; v < grid_size(&s->around); v++) {
        float spot[4] = {0.0f, 0.0f, 0.0f, s->all[v]};
        if (spot[3] > *faintest && is_brightest_around(s, v) && is_outside(s, v, spot))
            keep(s, spot);
    }
    return &s->view;
}

void surroundings_destroy(struct surroundings *s)
{
    if (!s)
        return;
    imager_destroy(s->imager);
    free(s->all);
    free(s->inside);
    free(s);
}
