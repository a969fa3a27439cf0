/* SPDX-License-Identifier: MIT */
/* hal/room/world.h -- a scene's objects and clutter as pieces that scatter, and the truth
 * about them. */
#ifndef ANLOS_HAL_ROOM_WORLD_H
#define ANLOS_HAL_ROOM_WORLD_H

#include "hal/room/mirror.h"
#include "hal/room/room.h"
#include "hal/room/scatter.h"
#include "hal/room/scene.h"

/* Which pieces are an object's. */
struct world_part {
    size_t point, n_points, facet, n_facets; /* first and number */
    double heading[3]; /* of a body that never goes anywhere; unit, horizontal */
};

struct world {
    struct scatter points, facets; /* hidden, where they really are */
    struct scatter clutter;        /* wall and room */
    struct scatter mirrored; /* those pieces of it that the wall mirrors, not owned */
    struct mirror mirror;
    size_t n_objects;
    struct room_object *objects; /* [n_objects] */
    struct world_part *parts;    /* [n_objects] */
    double up[3];                /* unit: of the vehicle, or the array's y axis */
};

/* Everything as at time 0, of a drive too.  path: for errors.  0, -EINVAL (an object
 * behind the wall), -ENOMEM. */
int world_create(struct world *out, const struct scene *scene, const struct survey *s,
                 const char *path, struct error *why);
void world_clear(struct world *w);

/* The middle of the elements, speakers and microphones alike, where the stage is at 0. */
void world_array_centre(const struct survey *s, double out[3]);

#endif
