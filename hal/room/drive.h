/* SPDX-License-Identifier: MIT */
/* hal/room/drive.h -- the vehicle of a drive: how it moves, and where that brings it and
 * its array. */
#ifndef ANLOS_HAL_ROOM_DRIVE_H
#define ANLOS_HAL_ROOM_DRIVE_H

#include <stddef.h>

#include "hal/room/room.h"
#include "hal/room/scene.h"

struct drive {
    const struct scene_drive *scene; /* not owned; NULL: the vehicle stands */
    const struct survey *survey;     /* its mount; not owned */
    double (*places)[3];             /* [n_places]: x, y, yaw at every DRIVE_STEP_S */
    size_t n_places;
};

/* The array frame at a time, over ground, wherever it rocks just now: ground = origin_m +
 * x axes[0] + y axes[1] + z axes[2], where ground is the array frame of time 0. */
struct drive_frame {
    double origin_m[3], axes[3][3];
};

/* drive: NULL when there is none.  0, -ENOMEM. */
int drive_create(struct drive *out, const struct scene_drive *drive,
                 const struct survey *s);
void drive_clear(struct drive *d);

/* A time of the drive, 0..period, of any. */
double drive_time_s(const struct drive *d, double t_s);
void drive_ego(const struct drive *d, double t_s, struct room_ego *out);
void drive_frame(const struct drive *d, double t_s, struct drive_frame *out);

void drive_to_ground(const struct drive_frame *f, const double p[3], double out[3]);
void drive_from_ground(const struct drive_frame *f, const double p[3], double out[3]);

/* The same of a direction. */
void drive_turn_from_ground(const struct drive_frame *f, const double v[3],
                            double out[3]);

#endif
