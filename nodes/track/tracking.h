/* SPDX-License-Identifier: MIT */
/* nodes/track/tracking.h -- the node track: what comes goes to
 * recon/tracking/object_tracker.h, and each image's objects come back as a list. */
#ifndef ANLOS_NODES_TRACK_TRACKING_H
#define ANLOS_NODES_TRACK_TRACKING_H

#include "msgs/detections.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/volume.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/loop.h"
#include "recon/tracking/object_tracker.h"

struct tracking;

extern const struct loop tracking_loop;

/* node is not owned; NULL: for the steps below alone.  0, -EINVAL (a value out of its
 * range), -ENOMEM. */
int tracking_create(struct tracking **out, struct node *node,
                    const struct object_tracker_config *cfg);

/* Each takes a message as it was published.  0, -ENOMEM, -EINVAL (the error says
 * why). */
int tracking_survey(struct tracking *t, const Anlos__Survey *survey, struct error *why);
int tracking_walls(struct tracking *t, const Anlos__WallList *walls, int64_t capture_ns,
                   struct error *why);
void tracking_ego(struct tracking *t, const Anlos__EgoMotion *ego, int64_t capture_ns);

bool tracking_has_wall(const struct tracking *t);

/* The objects of a volume; detections_free the list.  As object_tracker_volume. */
int tracking_volume(struct tracking *t, const Anlos__Volume *volume, int64_t capture_ns,
                    Anlos__DetectionList **out, struct error *why);

struct track_counts tracking_counts(const struct tracking *t);
void tracking_destroy(struct tracking *t);

#endif
