/* SPDX-License-Identifier: MIT */
/* recon/tracking/object_tracker.h -- an image to the list of hidden objects, where they
 * really are. Of a static array the objects of image after image are tracked
 * (recon/tracking/track.h); of a scan, or when asked for, each list stands for itself.
 *
 * A track has a place once a wall that is known now has shown where it is
 * (recon/tracking/track.h); without one it is listed as something that is there, with
 * virtual_m alone.  Only until a wall is known the first time all positions are virtual
 * (mirrored = false).  What is not known of the wall is in what is listed: its errors in
 * the covariance of a place, whether it is there at all in the existence.
 *
 * Who comes from beyond the gate is told as soon as he is followed there, as far as he is
 * heard (processing_listen_beyond); of the view, which ends at the gate, he is no part.
 *
 * Over ground a vehicle that says nothing of its motion, ever, counts as standing.  One
 * that stops saying it is taken to move on as it did; after EGO_MAX_AGE_NS of that the
 * list says ego_unknown and the tracks become less certain quickly. */
#ifndef ANLOS_RECON_TRACKING_OBJECT_TRACKER_H
#define ANLOS_RECON_TRACKING_OBJECT_TRACKER_H

#include "dsp/error.h"
#include "recon/detection/detector.h"
#include "recon/detection/objects.h"
#include "recon/ego.h"
#include "recon/tracking/track.h"
#include "recon/volume.h"
#include "recon/walls/walls.h"

enum object_tracker_mode {
    OBJECT_TRACKER_AUTO, /* tracks of a static array, else lists */
    OBJECT_TRACKER_LISTS,
    OBJECT_TRACKER_TRACKS,
};

struct object_tracker_config {
    struct detector_config detector;
    enum object_tracker_mode mode;
    struct track_config track;
    double clutter;     /* false detections that are expected in an image, > 0 */
    double look_s;      /* recon/tracking/timing.h */
    double walls_s;     /* walls that were heard longer ago are not known any more */
    double sidelobe_db; /* the array's, below what makes them (sidelobes.h) */
};

/* What holds where nothing is said; of a static array cells are compared with what is
 * around them (detector.cfar), as its images are never free of clutter. */
void object_tracker_config_default(struct object_tracker_config *cfg, bool is_static);

struct object_tracker;

/* 0, -EINVAL (a value out of its range), -ENOMEM. */
int object_tracker_create(struct object_tracker **out,
                          const struct object_tracker_config *cfg);

/* Copies it.  0, -ENOMEM. */
int object_tracker_survey(struct object_tracker *t, const struct survey *survey);

/* The walls as they stand at an instant.  0, -EINVAL: a stamp that is none. */
int object_tracker_walls(struct object_tracker *t, const struct walls *walls,
                         int64_t capture_ns);

/* How the vehicle moves; NULL: somebody told of it, but not that. */
void object_tracker_ego(struct object_tracker *t, const struct ego_motion *motion,
                        int64_t capture_ns);

bool object_tracker_has_survey(const struct object_tracker *t);

/* survey_id of what it was given; 0: nothing. */
uint64_t object_tracker_survey_id(const struct object_tracker *t);

/* Is a wall known at all? */
bool object_tracker_has_wall(const struct object_tracker *t);

/* The objects of a volume, at its stamp.  0, -EAGAIN (its survey is not known yet),
 * -EINVAL (not a volume), -ESTALE (older than the one before), -ENOMEM; the error says
 * why. */
int object_tracker_volume(struct object_tracker *t, const struct volume *volume,
                          struct object_list *out, struct error *why);

struct track_counts object_tracker_counts(const struct object_tracker *t);
void object_tracker_destroy(struct object_tracker *t);

#endif
