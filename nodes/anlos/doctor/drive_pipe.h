/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/drive_pipe.h -- a simulated drive through all stages
 * (recon/pipeline.h), in one process at simulated time, with a launch file's settings:
 * the same scene gives the same tracks each time. */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_DRIVE_PIPE_H
#define ANLOS_NODES_ANLOS_DOCTOR_DRIVE_PIPE_H

#include "hal/room/room.h"
#include "msgs/array.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/tensor.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/launchfile.h"
#include "recon/pipeline.h"

/* What the nodes array and can would publish in a simulated drive, ping by ping, at
 * simulated time. */

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

struct drive_pipe {
    const struct launchfile *launch;
    struct drive_world world;
    struct pipeline *pipeline;
    struct object_tracker *detector; /* of each image by itself; NULL: there is nothing
                                      * to be detected */
    struct object_list detected;
    struct volume volume;     /* the newest; borrows from the pipeline */
    uint64_t wall_lists;      /* that the detector has taken */
    int64_t ego_ns, given_ns; /* of the next message */
    double ping_s;            /* how long one is */
    char note[128];           /* the newest of the pipeline about its pings and images */
};

/* draw: of what is random in the scene (room_load_drawn).  The launch file outlives it.
 * 0, or a negative errno with an error. */
int drive_pipe_create(struct drive_pipe *p, const struct launchfile *l, const char *scene,
                      uint32_t draw, size_t threads, struct error *why);

/* Goes on to the next image: its lists, which detections_free frees, tracked and not
 * (NULL where nothing is hidden); the stamp of its newest ping, and when that had ended.
 * 0 or a negative errno: -ENODATA when of many pings in a row none makes an image. */
struct drive_image {
    Anlos__DetectionList *tracks, *detections;
    double t_s, out_s;
};
int drive_pipe_next(struct drive_pipe *p, struct drive_image *out, struct error *why);
void drive_pipe_clear(struct drive_pipe *p);

#endif
