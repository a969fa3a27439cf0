/* SPDX-License-Identifier: MIT */
/* anlos/walls.h -- the walls that mirror sound: given, configured, or heard. */
#ifndef ANLOS_WALLS_H
#define ANLOS_WALLS_H

#include <stddef.h>
#include <stdint.h>

#include <anlos/error.h>

enum anlos_wall_origin {
    ANLOS_WALL_CONFIGURED, /* of the survey, exact */
    ANLOS_WALL_GIVEN,      /* by the vehicle */
    ANLOS_WALL_ESTIMATED   /* from echoes */
};

struct anlos_wall {   /* { p : normal . p = distance_m } */
    size_t size;      /* sizeof(struct anlos_wall); of an array the first one's counts */
    uint32_t id;      /* from 1 */
    double normal[3]; /* of length 1 */
    double distance_m;
    double covariance[6]; /* aa ab ad bb bd dd: turns of the normal about the axis in the
                             plane that is nearest to `up` (a), and about normal x that
                             axis (b), rad, and distance_m; all 0: known exactly */
    double gate_m[2];     /* near, far: ranges that are seen by way of it; 0, 0: all */
    double existence;     /* 0..1 */
    double unseen_s;      /* since it was last seen or given */
    int origin;           /* enum anlos_wall_origin */
    double ends_m[2]; /* where it begins and ends, along normal x upright (as for b) from
                         the point of it that is nearest to the frame's origin; 0, 0:
                         that is not known */
};

#endif
