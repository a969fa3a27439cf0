/* SPDX-License-Identifier: MIT */
/* hal/room/traffic.h -- the hidden objects of a drive at a time: their pieces in motion,
 * over ground. */
#ifndef ANLOS_HAL_ROOM_TRAFFIC_H
#define ANLOS_HAL_ROOM_TRAFFIC_H

#include "hal/room/emitter.h"
#include "hal/room/world.h"

#define TRAFFIC_SPAN_S 0.03 /* what moves goes straight on for the time of an echo */

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
