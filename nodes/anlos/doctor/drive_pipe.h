/* SPDX-License-Identifier: MIT */
/* nodes/anlos/doctor/drive_pipe.h -- a simulated drive through all stages
 * (recon/pipeline.h), in one process at simulated time, with a launch file's settings:
 * the same scene gives the same tracks each time. */
#ifndef ANLOS_NODES_ANLOS_DOCTOR_DRIVE_PIPE_H
#define ANLOS_NODES_ANLOS_DOCTOR_DRIVE_PIPE_H

#include "msgs/detections.pb-c.h"
#include "nodes/anlos/doctor/drive_world.h"
#include "nodes/rt/launchfile.h"
#include "recon/pipeline.h"

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
