/* SPDX-License-Identifier: MIT */
/* hal/room/mirror.h -- the wall as a mirror that may end and have openings: sound takes
 * the way by it only where the straight line from the image behind it meets a piece of
 * it. Edges are sharp: what bends around them is left out. */
#ifndef ANLOS_HAL_ROOM_MIRROR_H
#define ANLOS_HAL_ROOM_MIRROR_H

#include <stdbool.h>

#include "hal/room/scene.h"
#include "recon/survey.h"

struct mirror {
    double normal[3], distance_m; /* { p : normal . p = distance_m } */
    double along[3]; /* unit, horizontal, in the wall: x of one straight ahead */
    const double (*spans_m)[2]; /* [n_spans] along it, not owned; none: it has no end */
    unsigned n_spans;
};

/* The survey's wall, cut as the scene says; up: unit. */
void mirror_set(struct mirror *m, const struct survey *s, const struct scene_wall *wall,
                const double up[3]);

/* Is there any of it at a place, seen along its normal? */
bool mirror_is_at(const struct mirror *m, const double p[3]);

/* Does it reflect what goes from an image behind it to p, or from p to the image? */
bool mirror_reflects(const struct mirror *m, const double image[3], const double p[3]);

#endif
