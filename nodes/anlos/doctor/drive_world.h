/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/drive_world.h -- what the nodes array and can would publish in a
 * simulated drive, ping by ping, at simulated time. */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_DRIVE_WORLD_H
#define ANLOS_NODES_ANLOS_DOCTOR_DRIVE_WORLD_H

#include "hal/room/room.h"
#include "msgs/array.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"

#define DRIVE_EGO_NS  20000000  /* between messages of the vehicle's motion */
#define DRIVE_WALL_NS 100000000 /* of the wall, where the vehicle tells it */

struct drive_world {
    struct room *room;
    struct room_stream *stream;
    Anlos__Survey *survey;
    size_t n_samples, n_speakers;
    uint64_t n;         /* pings of this pass so far */
    uint32_t *clipped;  /* [n_microphones], all 0; of not_finite too */
    uint32_t *speakers; /* [n_speakers] of a round */
    int64_t begin_ns;   /* stamp of the stream's first sample */
    struct tensor_view view;
};

struct drive_world_config {
    const char *scene;
    const struct firing *firing; /* NULL: as the scene says */
    uint32_t draw;               /* of room_load_drawn */
    const uint32_t *speakers;    /* [n_speakers] of a round; 0: all */
    size_t n_speakers;
};

/* 0, -ENOTSUP (not a drive), errors of room_load, -ENOMEM. */
int drive_world_create(struct drive_world *w, const struct drive_world_config *cfg,
                       struct error *why);

/* The endless shot restarts, right after what came before. */
int drive_world_shoot(struct drive_world *w, enum pass pass, struct error *why);

/* The next ping, which borrows from w.  0, -ENOMEM. */
int drive_world_ping(struct drive_world *w, enum pass pass, Anlos__Ping *out,
                     int64_t *capture_ns);

/* World time of a stamp. */
double drive_world_s(int64_t stamp_ns);
void drive_world_ego(const struct drive_world *w, int64_t stamp_ns,
                     Anlos__EgoMotion *out);

struct drive_walls {
    Anlos__WallList list;
    Anlos__Wall wall, *walls[1];
    Anlos__Vec3 normal;
    double covariance[6];
};

/* The wall in the vehicle frame, as its perception may tell it: where it really is, give
 * or take 2 cm and 0.3 degrees. */
void drive_world_wall(const struct drive_world *w, int64_t stamp_ns,
                      struct drive_walls *out);
void drive_world_clear(struct drive_world *w);

#endif
