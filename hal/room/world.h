/* SPDX-License-Identifier: MIT */
/* hal/room/world.h -- a scene's objects and clutter as pieces that scatter, at rest and
 * as they go in a drive, and the truth about them. */
#ifndef ANLOS_HAL_ROOM_WORLD_H
#define ANLOS_HAL_ROOM_WORLD_H

#include <stdbool.h>

#include "hal/room/emitter.h"
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

/* Is it there at a time of the drive, 0..period? */
bool world_has(const struct scene_object *o, double t_s);

#define TRAFFIC_SPAN_S 0.03 /* what moves goes straight on for the time of an echo */

/* The hidden objects of a drive at a time: their pieces in motion, over ground. */
struct traffic {
    const struct scene *scene; /* neither is owned */
    const struct world *world;
    struct emitter_piece *pieces; /* [n], set by traffic_set */
    size_t n;
    struct emitter_piece *clutter;        /* [world->clutter.n]: at rest */
    const struct emitter_piece *mirrored; /* [world->mirrored.n], the last of them */
};

/* 0, -ENOMEM. */
int traffic_create(struct traffic *out, const struct scene *scene,
                   const struct world *world);
void traffic_clear(struct traffic *t);

/* The objects that are there at a time of the drive, as they move for TRAFFIC_SPAN_S. */
void traffic_set(struct traffic *t, double t_s);

/* An object's centre (as room_object has it), velocity and extent at a time, over ground.
 */
void traffic_object(const struct traffic *t, size_t object, double t_s, double centre[3],
                    double velocity[3], double extent[3]);

#endif
