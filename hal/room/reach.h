/* SPDX-License-Identifier: MIT */
/* hal/room/reach.h -- how far sound gets in a simulated room. */
#ifndef ANLOS_HAL_ROOM_REACH_H
#define ANLOS_HAL_ROOM_REACH_H

#include "hal/room/drive.h"
#include "hal/room/pose.h"
#include "hal/room/traffic.h"
#include "hal/room/world.h"

/* No sound takes a longer way from speaker to microphone, at any position.  Leaves the
 * pose at the last one. */
double reach_longest_path_m(struct pose *pose, const struct world *world);

/* The same at any time of a drive, by steps of it. */
double reach_longest_drive_m(struct pose *pose, const struct drive *drive,
                             struct traffic *traffic);

#endif
