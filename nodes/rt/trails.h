/* SPDX-License-Identifier: MIT */
/* nodes/rt/trails.h -- where tracks were in the last seconds, over ground, in the frame
 * of the newest list: a vehicle's motion since is taken out. */
#ifndef ANLOS_NODES_RT_TRAILS_H
#define ANLOS_NODES_RT_TRAILS_H

#include <stdbool.h>

#include "msgs/detections.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "recon/ego.h"

#define TRAILS_MAX        64 /* tracks; of more, those that were seen last */
#define TRAILS_MAX_POINTS 160

struct trail_point {
    int64_t stamp_ns;
    double at_m[3];
    bool measured; /* else predicted */
};

struct trail {
    uint32_t id; /* 0: none */
    size_t n;
    struct trail_point points[TRAILS_MAX_POINTS]; /* [n], the oldest first */
};

struct trails {
    int64_t keep_ns; /* older points are forgotten, and tracks without any */
    int64_t step_ns; /* between two points, at least keep_ns / (TRAILS_MAX_POINTS - 1) */
    struct ego_path ego;
    int64_t frame_ns; /* the frame that the points are in; 0: none yet */
    struct trail own; /* the vehicle's */
    struct trail list[TRAILS_MAX];
};

void trails_init(struct trails *t, int64_t keep_ns, int64_t step_ns);
void trails_ego(struct trails *t, const Anlos__EgoMotion *m, int64_t capture_ns);

/* Adds the places of a list of tracks, of which the last point of each is the newest.
 * Others have no trails.  Where the motion is not known, the vehicle counts as standing.
 * A list that is older than the one before is of another run: it restarts. */
void trails_take(struct trails *t, const Anlos__DetectionList *list, int64_t capture_ns);

/* A stamp with which one can reckon; messages with another are ignored. */
static inline bool trails_stamp_holds(int64_t ns)
{
    return ns >= 0 && ns <= INT64_MAX / 2;
}

/* NULL: none. */
const struct trail *trails_find(const struct trails *t, uint32_t id);

#endif
