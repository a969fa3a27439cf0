/* SPDX-License-Identifier: MIT */
#include "recon/detection/beyond.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "recon/detection/lobes.h"
#include "recon/imaging/imager.h"
#include "recon/planning/probe.h"

#define ASIDE  0.35 /* of the range, on each side: the grating lobes of 20 degrees */
#define ALONG  0.25 /* m, before the volume and behind it */
#define OTHER  0.01 /* of an intensity, that an image of phases leaves at other ranges */
#define INSIDE 0.05 /* likewise, an image of power of what it shows, anywhere */

struct beyond {
    const struct trace_set *set;
    const struct grid *volume;
    bool of_power;
    struct grid grid; /* around it, coarse */
    float *intensity;
};

/* The volume's grid, continued on all sides. */
static void look_around(struct beyond *b, double band_hz[2])
{
    struct grid wide = *b->volume;
    double near_m = wide.origin_m[2];
    double far_m = near_m + wide.step_m[2] * (double)(wide.n[2] - 1);

    for (int a = 0; a < 3; a++) {
        double after_m = a < 2 ? ASIDE * fabs(far_m) : ALONG;
        double before_m = a < 2 ? after_m : fmin(ALONG, fmax(0.5 * near_m, 0.0));
        double before = ceil(before_m / wide.step_m[a]);
        wide.origin_m[a] -= before * wide.step_m[a];
        wide.n[a] += (size_t)(before + ceil(after_m / wide.step_m[a]));
    }
    probe_view(b->set, &wide, band_hz, &b->grid);
}

static int image(struct beyond *b, const double band_hz[2], struct pool *pool)
{
    struct imager_options plain;
    const char *why;
    struct imager *im = NULL;
    const struct imager_config cfg = {.method = "fast",
                                      .geometry = b->set->geometry,
                                      .format = b->set->format,
                                      .band_hz = {band_hz[0], band_hz[1]},
                                      .gate_m = {b->set->gate_m[0], b->set->gate_m[1]},
                                      .grid = b->grid,
                                      .pool = pool,
                                      .options = &plain};

    imager_options_default(&plain);
    plain.dmo = 0;
    plain.taper = true;
    int err = imager_create(&im, &cfg, &why);
    if (err)
        return err;
    b->intensity = malloc(grid_size(&b->grid) * sizeof *b->intensity);
    err = b->intensity ? trace_set_feed(b->set, im, pool) : -ENOMEM;
    if (!err)
        imager_image(im, b->intensity);
    imager_destroy(im);
    return err;
}

static bool is_outside(const struct beyond *b, const double at_m[3])
{
    const struct grid *v = b->volume;

    for (int a = 0; a < 3; a++) {
        double far_m = v->origin_m[a] + v->step_m[a] * (double)(v->n[a] - 1);
        if (at_m[a] < v->origin_m[a] || at_m[a] > far_m)
            return true;
    }
    return false;
}

static bool is_brightest_around(const struct beyond *b, size_t voxel)
{
    size_t near[26], n = grid_neighbours(&b->grid, voxel, near);

    for (size_t q = 0; q < n; q++)
        if (b->intensity[near[q]] > b->intensity[voxel])
            return false;
    return b->intensity[voxel] > 0.0f;
}

static void place(const struct grid *g, size_t voxel, double at_m[3])
{
    size_t at[3];

    grid_place(g, voxel, at);
    for (int a = 0; a < 3; a++)
        at_m[a] = g->origin_m[a] + g->step_m[a] * (double)at[a];
}

/* The brightest voxel of what an object covers, or within a step of its place. */
static float brightest(const struct beyond *b, const struct detection *d)
{
    const struct grid *g = &b->grid;
    size_t low[3], high[3];
    float most = 0.0f;

    for (int a = 0; a < 3; a++) {
        double at = (d->position_m[a] - g->origin_m[a]) / g->step_m[a];
        double half = fmax(0.5 * d->extent_m[a] / g->step_m[a], 1.0);
        double last = (double)(g->n[a] - 1);
        low[a] = (size_t)fmin(fmax(round(at - half), 0.0), last);
        high[a] = (size_t)fmin(fmax(round(at + half), 0.0), last);
    }
    for (size_t z = low[2]; z <= high[2]; z++)
        for (size_t y = low[1]; y <= high[1]; y++)
            for (size_t x = low[0]; x <= high[0]; x++)
                most = fmaxf(most, b->intensity[(z * g->n[1] + y) * g->n[0] + x]);
    return most;
}

struct candidate {
    double here; /* how bright a detection is in the coarse image, */
    double most; /* and what is outside and may make it; 0: nothing */
};

/* Echoes that few pairs hear are fainter in the coarse image than in one of power, so
 * that of what is in that the farthest only is a sidelobe. */
static void compare_inside(size_t n, struct candidate *c)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            c[i].most = fmax(c[i].most, INSIDE * c[j].here);
}

/* Of what stands there, the part that may be left at the other place. */
static double share(const struct beyond *b, const double from_m[3], const double to_m[3])
{
    bool reached = b->of_power || lobes_reach(b->set->geometry, from_m, to_m);
    return reached ? 1.0 : OTHER;
}

/* What is outside may itself be a sidelobe of what is in the volume. */
static void compare(const struct beyond *b, size_t voxel, const struct detection *found,
                    size_t n, struct candidate *c)
{
    double at_m[3], level = b->intensity[voxel];

    place(&b->grid, voxel, at_m);
    if (!is_outside(b, at_m) || !is_brightest_around(b, voxel))
        return;
    for (size_t i = 0; i < n; i++)
        if (c[i].here * share(b, found[i].position_m, at_m) > level)
            return;
    for (size_t i = 0; i < n; i++)
        c[i].most = fmax(c[i].most, level * share(b, at_m, found[i].position_m));
}

int beyond_judge(const struct trace_set *set, const struct grid *grid, double range_db,
                 bool of_power, struct pool *pool, struct detection *found, size_t n)
{
    struct beyond b = {.set = set, .volume = grid, .of_power = of_power};
    struct candidate *c = NULL;
    double band_hz[2];

    if (!n || set->geometry->pings_m)
        return 0;
    look_around(&b, band_hz);
    int err = image(&b, band_hz, pool);
    if (!err && !(c = calloc(n, sizeof *c)))
        err = -ENOMEM;
    for (size_t i = 0; !err && i < n; i++)
        c[i].here = brightest(&b, &found[i]);
    for (size_t v = 0; !err && v < grid_size(&b.grid); v++)
        compare(&b, v, found, n, c);
    if (!err && of_power)
        compare_inside(n, c);
    for (size_t i = 0; !err && i < n; i++) {
        if (!(c[i].most > 0.0))
            continue;
        double margin_db = 10.0 * log10(fmax(c[i].here / c[i].most, 1e-30)) + range_db;
        found[i].existence *= 1.0 - 1.0 / (1.0 + pow(10.0, margin_db / 5.0));
    }
    free(c);
    free(b.intensity);
    return err == -ENOTSUP ? 0 : err;
}
