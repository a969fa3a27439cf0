/* nodes/track/tracking.h -- the track node's step: an image to the list of hidden
 * objects, where they really are.  Of a fixed array the objects of image after image are
 * tracked (recon/track.h); of a scan, or when asked for, each list stands for itself.
 *
 * A track has a place once a wall that is known now has shown where it is
 * (recon/track.h); without one it is listed as something that is there, with virtual_m
 * and no position_m. Only until a wall is known the first time all positions are virtual
 * (mirrored = false). What is not known of the wall is in what is told: its errors in the
 * covariance of a place, whether it is there at all in the existence.
 *
 * Over ground a vehicle that says nothing of its motion, ever, counts as standing.  One
 * that stops saying it is taken to move on as it did; after EGO_MAX_AGE_NS of that the
 * list says ego_unknown and the tracks become less certain quickly. */
#ifndef ANLOS_NODES_TRACK_TRACKING_H
#define ANLOS_NODES_TRACK_TRACKING_H

#include "msgs/survey.pb-c.h"
#include "msgs/detections.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/rt/launchfile.h"
#include "nodes/track/detector.h"
#include "recon/track.h"

struct tracking_config {
    struct detector_config detector;
    enum launch_track_mode mode;
    struct track_config track;
    double clutter;     /* false detections that are expected in an image, > 0 */
    double look_s;      /* nodes/track/timing.h */
    double walls_s;     /* walls that were told of longer ago are not known any more */
    double sidelobe_db; /* the array's, below what makes them (nodes/track/ghosts.h) */
};

/* From a launch file; NULL: as one has it that says nothing. */
void tracking_config(struct tracking_config *cfg, const struct launchfile *l);

struct tracking;

/* 0, -EINVAL (a value out of its range), -ENOMEM. */
int tracking_create(struct tracking **out, const struct tracking_config *cfg);

/* Each takes a message as it was published.  0, -ENOMEM, -EINVAL (the error says
 * why). */
int tracking_survey(struct tracking *t, const Anlos__Survey *survey, struct error *why);
int tracking_walls(struct tracking *t, const Anlos__WallList *walls, int64_t capture_ns,
                   struct error *why);
void tracking_ego(struct tracking *t, const Anlos__EgoMotion *ego, int64_t capture_ns);

bool tracking_has_survey(const struct tracking *t);

/* Is a wall known at all? */
bool tracking_has_wall(const struct tracking *t);

/* The objects of a volume; objects_free the list.  0, -EAGAIN (its survey is not known
 * yet), -EINVAL (not a volume), -ESTALE (older than the one before), -ENOMEM; the
 * error says why. */
int tracking_volume(struct tracking *t, const Anlos__Volume *volume, int64_t capture_ns,
                    Anlos__DetectionList **out, struct error *why);

struct track_counts tracking_counts(const struct tracking *t);
void tracking_destroy(struct tracking *t);

#endif
