/* SPDX-License-Identifier: MIT */
/* hal/room/motion.h -- where an object of a drive is at a time: its path, straight from
 * knot to knot. */
#ifndef ANLOS_HAL_ROOM_MOTION_H
#define ANLOS_HAL_ROOM_MOTION_H

#include <stdbool.h>

#include "hal/room/scene.h"

/* Is it there at a time of the drive, 0..period? */
bool motion_present(const struct scene_object *o, double t_s);

struct motion {
    double position_m[3], velocity_m_s[3];
    double heading[3]; /* unit, horizontal: where it goes, a quarter of a second before
                          and after; where it stands, where it last went or will go; 0
                          when it never moves */
    double walked_m;   /* from the beginning of the path on */
};

/* At a time of the drive; up: unit, the direction that headings leave out. */
void motion_at(const struct scene_object *o, const double up[3], double t_s,
               struct motion *out);

#endif
