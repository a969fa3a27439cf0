/* SPDX-License-Identifier: MIT */
#include "recon/static_array/clutter_map.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/rank.h"
#include "recon/static_array/bodies.h"

#define REACH_M 0.15 /* what stands above the array comes nearer more slowly, */
#define ASIDE_M 0.08 /* but stays where it is along the array */
#define OVER    4.0f /* over the noise: clutter */
#define BRIGHTER                                                                         \
    10.0f            /* than before: new; what stands is sharper once the vehicle does */
#define SAMPLES 4096 /* that the noise is told from */

enum { IN_A_WINDOW = 4, KEPT = IN_A_WINDOW + 2 };

struct kept {
    int64_t stamp_ns;
    bool any;
    float noise;    /* the middle one of what is not muted; 0: all is */
    float *widened; /* [nz][ny][nx]: the brightest within reach */
};

struct clutter_map {
    struct grid grid;
    int64_t window_ns;
    struct kept kept[KEPT]; /* the newest first */
    float *part;            /* [nz][ny][nx], widened along z */
    float *whole;           /* [nz][ny][nx], the image before it is muted */
    struct bodies *bodies;
};

int clutter_map_create(struct clutter_map **out, const struct grid *grid,
                       int64_t window_ns)
{
    struct clutter_map *c = calloc(1, sizeof *c);

    if (!c)
        return -ENOMEM;
    *c = (struct clutter_map){.grid = *grid, .window_ns = window_ns};
    c->part = malloc(grid_size(grid) * sizeof *c->part);
    for (int k = 0; k < KEPT; k++)
        c->kept[k].widened = malloc(grid_size(grid) * sizeof(float));
    c->whole = malloc(grid_size(grid) * sizeof *c->whole);
    bool all = c->part && c->whole && !bodies_create(&c->bodies, grid);
    for (int k = 0; k < KEPT; k++)
        all = all && c->kept[k].widened;
    if (!all) {
        clutter_map_destroy(c);
        return -ENOMEM;
    }
    *out = c;
    return 0;
}

/* The brightest within `reach` cells of a row of n, stride apart. */
static void widen(const float *in, float *out, size_t n, size_t stride, size_t reach)
{
    for (size_t i = 0; i < n; i++) {
        size_t first = i > reach ? i - reach : 0;
        size_t last = i + reach < n ? i + reach : n - 1;
        float most = 0.0f;
        for (size_t k = first; k <= last; k++)
            most = fmaxf(most, in[k * stride]);
        out[i * stride] = most;
    }
}

static size_t reach_of(const struct grid *g, int axis, double reach_m)
{
    return (size_t)fmin(ceil(reach_m / g->step_m[axis]), (double)g->n[axis]);
}

static float noise_of(const float *image, size_t n)
{
    float sample[SAMPLES];
    size_t step = n / SAMPLES + 1, count = 0;

    for (size_t i = 0; i < n; i += step)
        if (image[i] > 0.0f)
            sample[count++] = image[i];
    return count ? rank_smallest(sample, count, count / 2 + 1) : 0.0f;
}

static void keep(struct clutter_map *c, const float *image, int64_t stamp_ns)
{
    const struct grid *g = &c->grid;
    size_t plane = g->n[0] * g->n[1];
    struct kept oldest = c->kept[KEPT - 1];

    memmove(c->kept + 1, c->kept, (KEPT - 1) * sizeof *c->kept);
    oldest.stamp_ns = stamp_ns;
    oldest.any = true;
    oldest.noise = noise_of(image, grid_size(g));
    c->kept[0] = oldest;
    for (size_t i = 0; i < plane; i++)
        widen(image + i, c->part + i, g->n[2], plane, reach_of(g, 2, REACH_M));
    for (size_t i = 0; i < g->n[1] * g->n[2]; i++)
        widen(c->part + i * g->n[0], oldest.widened + i * g->n[0], g->n[0], 1,
              reach_of(g, 0, ASIDE_M));
}

static bool index_of(const struct grid *g, int axis, double at_m, size_t *out)
{
    double i = round((at_m - g->origin_m[axis]) / g->step_m[axis]);

    if (!(i >= 0.0 && i < (double)g->n[axis]))
        return false;
    *out = (size_t)i;
    return true;
}

/* What was at a place of the array frame, a step before; 0: it was not imaged. */
static float before(const struct grid *g, const float *was, const struct mount *mount,
                    const struct ego_step *back, const double p[3], size_t row)
{
    double q[3];
    size_t x, z;

    mount_step_point(mount, back, p, q);
    if (!index_of(g, 0, q[0], &x) || !index_of(g, 2, q[2], &z))
        return 0.0f;
    return was[(z * g->n[1] + row) * g->n[0] + x];
}

static void mute(const struct grid *g, const struct kept *kept, const struct mount *mount,
                 const struct ego_step *back, float part, float *image)
{
    size_t v = 0;

    for (size_t z = 0; z < g->n[2]; z++)
        for (size_t y = 0; y < g->n[1]; y++)
            for (size_t x = 0; x < g->n[0]; x++, v++) {
                const double p[3] = {g->origin_m[0] + g->step_m[0] * (double)x,
                                     g->origin_m[1] + g->step_m[1] * (double)y,
                                     g->origin_m[2] + g->step_m[2] * (double)z};
                float most = before(g, kept->widened, mount, back, p, y);
                if (most > OVER * kept->noise && image[v] < BRIGHTER * part * most)
                    image[v] = 0.0f;
            }
}

/* The newest that has no ping in common with an image. */
static const struct kept *find(const struct clutter_map *c, int64_t stamp_ns)
{
    for (int k = 0; k < KEPT; k++)
        if (c->kept[k].any && stamp_ns - c->kept[k].stamp_ns >= c->window_ns)
            return &c->kept[k];
    return NULL;
}

void clutter_map_mute(struct clutter_map *c, const struct ego_path *path,
                      const struct mount *mount, int64_t stamp_ns, double part,
                      float *image)
{
    struct kept was = {.any = false};
    struct ego_step back;

    if (c->kept[0].any && stamp_ns < c->kept[0].stamp_ns)
        clutter_map_reset(c);
    const struct kept *found = find(c, stamp_ns);
    bool known = found && !ego_path_between(path, stamp_ns, found->stamp_ns, &back);
    if (known)
        was = *found;
    /* It takes the place of the oldest, which is not the one that was found. */
    if (part >= 1.0 &&
        (!c->kept[0].any || stamp_ns - c->kept[0].stamp_ns >= c->window_ns / IN_A_WINDOW))
        keep(c, image, stamp_ns);
    if (!known)
        return;
    memcpy(c->whole, image, grid_size(&c->grid) * sizeof *image);
    float noise = noise_of(image, grid_size(&c->grid));
    mute(&c->grid, &was, mount, &back, (float)part, image);
    bodies_restore(c->bodies, c->whole, OVER * noise, image);
}

void clutter_map_reset(struct clutter_map *c)
{
    for (int k = 0; k < KEPT; k++)
        c->kept[k].any = false;
}

void clutter_map_destroy(struct clutter_map *c)
{
    if (!c)
        return;
    for (int k = 0; k < KEPT; k++)
        free(c->kept[k].widened);
    bodies_destroy(c->bodies);
    free(c->whole);
    free(c->part);
    free(c);
}
