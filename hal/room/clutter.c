/* SPDX-License-Identifier: MIT */
#include "hal/room/clutter.h"

#include <errno.h>
#include <stdbool.h>

#include "hal/random.h"
#include "hal/room/vector.h"

#define WALL_REACH_M 1.5 /* on the wall, from the array's foot point */

enum { STREAM_CLUTTER = 1, STREAM_WALL = 2 };

/* On the side of the wall where the array is not? */
static bool beyond_wall(const struct survey *s, const double centre[3], const double p[3])
{
    double array_side = vector_dot(s->wall_normal, centre) - s->wall_distance_m;
    double side = vector_dot(s->wall_normal, p) - s->wall_distance_m;
    return array_side < 0 ? side > 0 : side < 0;
}

/* Diffuse patches around the point of the wall that is nearest to the array. */
static int add_wall(struct scatter *out, const struct scene *scene,
                    const struct survey *s, const struct mirror *mirror,
                    const double centre[3])
{
    const struct scene_wall *wall = scene->wall_sound;
    static const double up[3] = {0, 1, 0};
    struct scatter_plane plane;
    struct random r;
    double foot[3];
    random_seed(&r, (uint64_t[]){scene->seed, STREAM_WALL}, 2);
    vector_add(centre, s->wall_distance_m - vector_dot(s->wall_normal, centre),
               s->wall_normal, foot);
    scatter_plane_set(&plane, foot, s->wall_normal, up);
    for (uint32_t i = 0; i < wall->patches; i++) {
        double p[3];
        vector_add(foot, WALL_REACH_M * (2 * random_even(&r) - 1), plane.u, p);
        vector_add(p, WALL_REACH_M * (2 * random_even(&r) - 1), plane.v, p);
        vector_add(p, wall->roughness_m * random_normal(&r), s->wall_normal, p);
        double length_m = wall->scattering_length_m * random_normal(&r);
        if (mirror_is_at(mirror, p) && scatter_add_point(out, p, length_m) < 0)
            return -ENOMEM;
    }
    return 0;
}

/* Anywhere around the array at a distance of near_m to far_m, before the wall. */
static int add_room(struct scatter *out, const struct scene *scene,
                    const struct survey *s, const double centre[3])
{
    const struct scene_clutter *c = scene->clutter;
    struct random r;
    random_seed(&r, (uint64_t[]){scene->seed, STREAM_CLUTTER}, 2);
    for (uint32_t i = 0; i < c->points; i++) {
        double p[3], way[3] = {random_normal(&r), random_normal(&r), random_normal(&r)};
        vector_normalize(way);
        vector_add(centre, c->near_m + (c->far_m - c->near_m) * random_even(&r), way, p);
        if (beyond_wall(s, centre, p))
            vector_mirror(s->wall_normal, s->wall_distance_m, p, p);
        if (scatter_add_point(out, p, c->scattering_length_m * random_normal(&r)) < 0)
            return -ENOMEM;
    }
    return 0;
}

int clutter_add(struct scatter *out, size_t *n_patches, const struct scene *scene,
                const struct survey *s, const struct mirror *mirror,
                const double centre[3])
{
    int err = add_wall(out, scene, s, mirror, centre);
    *n_patches = out->n;
    return err ? err : add_room(out, scene, s, centre);
}
