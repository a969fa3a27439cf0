/* SPDX-License-Identifier: MIT */
#include "recon/detection/beyond.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "recon/detection/lobes.h"

#define OTHER  0.01 /* of an intensity, that an image of phases leaves at other ranges */
#define INSIDE 0.05 /* likewise, an image of power of what it shows, anywhere */

/* The brightest voxel of what an object covers, or within a step of its place. */
static float brightest(const struct beyond *b, const struct detection *d)
{
    const struct grid *g = &b->around->grid;
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
                most = fmaxf(most, b->around->intensity[(z * g->n[1] + y) * g->n[0] + x]);
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
    bool reached = b->of_power || lobes_reach(b->geometry, from_m, to_m);
    return reached ? 1.0 : OTHER;
}

/* What is outside may itself be a sidelobe of what is in the volume. */
static void compare(const struct beyond *b, const float spot[4],
                    const struct detection *found, size_t n, struct candidate *c)
{
    const double at_m[3] = {spot[0], spot[1], spot[2]}, level = spot[3];

    for (size_t i = 0; i < n; i++)
        if (c[i].here * share(b, found[i].position_m, at_m) > level)
            return;
    for (size_t i = 0; i < n; i++)
        c[i].most = fmax(c[i].most, level * share(b, at_m, found[i].position_m));
}

int beyond_judge(const struct beyond *b, struct detection *found, size_t n)
{
    struct candidate *c = calloc(n + 1, sizeof *c);

    if (!c)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        c[i].here = brightest(b, &found[i]);
    for (size_t s = 0; s < b->around->n_spots; s++)
        compare(b, b->around->spots[s], found, n, c);
    if (b->of_power)
        compare_inside(n, c);
    for (size_t i = 0; i < n; i++) {
        if (!(c[i].most > 0.0))
            continue;
        double margin_db = 10.0 * log10(fmax(c[i].here / c[i].most, 1e-30)) + b->range_db;
        found[i].existence *= 1.0 - 1.0 / (1.0 + pow(10.0, margin_db / 5.0));
    }
    free(c);
    return 0;
}

int beyond_judge_traces(const struct trace_set *set, const struct grid *volume,
                        double range_db, bool of_power, struct pool *pool,
                        struct detection *found, size_t n)
{
    const struct imager_config wanted = trace_set_imager(set, volume, pool);
    struct beyond b = {
        .geometry = set->geometry, .range_db = range_db, .of_power = of_power};
    struct surroundings *s;

    if (!n)
        return 0;
    int err = surroundings_create(&s, &wanted);
    if (err)
        return err == -ENOTSUP ? 0 : err;
    err = trace_set_feed(set, surroundings_imager(s), pool);
    if (!err) {
        b.around = surroundings_image(s);
        err = b.around ? beyond_judge(&b, found, n) : -ECANCELED;
    }
    surroundings_destroy(s);
    return err;
}
