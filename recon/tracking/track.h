/* SPDX-License-Identifier: MIT */
/* recon/tracking/track.h -- detections of image after image to objects that stay:
 * predicted with the filter of recon/tracking/track_filter.h, assigned to each other at
 * the least cost (global nearest neighbour, recon/tracking/assignment.h), confirmed and
 * ended by recon/tracking/track_life.h.
 *
 * What is heard in several places at once that move as one is one object, and one track
 * (recon/tracking/track_body.h).
 *
 * Detections come and tracks are told in the vehicle frame (x forward, y left, z up) at
 * the stamp of their image; kept they are over ground, in the vehicle frame of the first
 * image, to which each later one's ego motion is added up.
 *
 * What is measured is a mirror image; where that really is, a mirror tells, and what is
 * known of mirrors changes.  So each track keeps the mirror, over ground, that its state
 * holds for, and follows that (recon/tracking/track_mirror.c):
 *
 *   - its mirror was estimated anew: the state is imaged by the old one and mirrored at
 *     the new one, velocity and covariance with it;
 *   - its mirror is not known any more: the state is imaged, and lives on where it is
 *     imaged; as soon as a mirror stands before it there, it is mirrored at that one;
 *   - what a mirror moved by more than is not known of it may really be where it was
 *     imaged, or where it was told to be (the wall itself moved): the covariance grows by
 *     that difference, so that the next detection decides;
 *   - several show it at one place: the weaker detection goes with the stronger and feeds
 *     no other track.  Each mirror is a look of its own, and measures place and velocity
 *     anew, by errors of its own; it is followed by the one that it was measured by,
 *     unless another shows it four times as loud.
 *
 * A track has a place when it was measured by way of a mirror that has been known ever
 * since and has not jumped; before, it is reported without one, and ends where no mirror
 * that is known shows it in place_looks: a new track of the same thing is confirmed
 * later. None has a place beyond its mirror: a track that coasts ends there (what is
 * faster or longer than a walker, where it is surely beyond), and what is told stays on
 * this side.
 *
 * What is fast or long has one model of motion, nearly constant velocity: 0.5 m2/s3 is an
 * acceleration of 1 m/s2 rms that lasts a quarter of a second (twice variance times time,
 * Singer 1970); a car that brakes with 1.5 m/s2 is within it.  Who is heard and goes like
 * a walker has two (recon/tracking/track_models.h): of walkers of another simulator they
 * took the error of places from 10 to 8 cm, of two who cross from 16 to 11, and of those
 * who are lost in front of an opening from 35 to 23, where one model had to choose
 * between the wobble of each step and a lag when somebody stops.  What is heard of a
 * walker much fainter than he was is believed less: behind an edge, or off the end of a
 * wall, a part of him is heard for a moment longer, and stays where the edge is.  Two
 * walkers who go as one within join_m for a while are one who was heard twice.
 */
#ifndef ANLOS_RECON_TRACKING_TRACK_H
#define ANLOS_RECON_TRACKING_TRACK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/ego.h"
#include "recon/tracking/track_life.h"

#define TRACKS_MAX       64
#define TRACK_ID_MAX     254 /* names are 1 to that */
#define TRACK_DETECTIONS 64

struct track_config {
    double acceleration_psd_m2_s3; /* of walkers it sets those of both models */
    double lost_ego_psd_m2_s3;     /* on top while the vehicle's motion is not known */
    double new_speed_m_s;         /* standard deviation on each axis, before it is seen */
    double wander_m;              /* the brightest spot of an object about its middle */
    double gate2;                 /* of Mahalanobis distances, squared */
    double join_m;                /* what is nearer to an object's detection is its own */
    double detection_probability; /* in an image that shows where the object is */
    double new_existence;         /* of the first detection, times that one's */
    struct track_life_config life;
    double coast_s;     /* after that time unseen a track ends; without a name after two
                           looks */
    double place_looks; /* so many that show it nowhere end a track without a place:
                           before a new one of it, which takes a look, is confirmed */
    double rest_m;      /* by so much a thing at rest seems to wander, one sigma */
    double rest_s;      /* of recon/tracking/track_rest.h: what is older fades */
    double id_rest_s;   /* an id is not given again for so long */
    double reset_s;     /* a stamp that is older by more is a new beginning */
};

/* 0.5 m2/s3; 9 (a vehicle brakes with 3 m/s2 for half a second); 2.5 m/s; 5 cm;
 * 13.8 (99.9 % in the plane); 0.5 m; 0.8; 0.3; 2 of 3 looks and 0.95 (3 of 5 of images
 * with what stands, and for a while after: one hit of two looks more, where more than one
 * is asked for), ends below 0.02, stays 30 s, hides after 2 s for 2 s; coasts 1.5 s, 0.75
 * looks without a place; 5 cm; 1.5 s; 30 s; 1 s. */
void track_config_default(struct track_config *cfg);

struct track_detection {
    double position_m[3], covariance_m2[6]; /* vehicle frame; xx xy xz yy yz zz */
    double height_m2[6];                    /* of that, what the assumed height does */
    double extent_m[3];                     /* full size */
    double existence;                       /* 0..1 */
    double remains; /* a power: what is fainter may be left there of a background that was
                       subtracted, and has to move before it is named; 0: none is */
    double proven;  /* 0..1: by pings one by one; 0: not known */
    bool moves;     /* by itself: so the phases of the image's pings have it */
    bool has_course;       /* or may: they have it at, */
    double course_m_s[2];  /* a velocity over ground, along the vehicle's axes, */
    double course_doubt;   /* which is wrong with that probability; */
    double gliding_m_s[2]; /* what rests overhead or behind has 0 to 2 times this one */
    double power;          /* of its echo, any unit, > 0 */
    double lag_s;          /* recon/tracking/track_filter.h */
    double middle_m[2];    /* of all that is bright there, from its place */
    bool height_assumed;
    double along_m, range_m; /* as the array heard it, from track_array.at_m */
    double sight[2]; /* along which it was heard, away from the wall; unit, or 0 */
    uint32_t mirror; /* the id of the one it was mirrored at; 0: it is where it is imaged
                      */
};

#define TRACK_MIRRORS 8

struct track_mirror { /* the points p with normal . p = distance_m, in the vehicle frame
                       */
    uint32_t id;      /* from 1; 0: none, things are where they are imaged */
    double normal[3], distance_m; /* of length 1, away from the array */
    double sigma_m, sigma_rad;    /* of its distance and of its turn about the array */
};

struct track_array {         /* vehicle frame at the stamp, in the plane */
    double at_m[2], axis[2]; /* where it was in the mean of an image's pings */
};

struct track_scan {
    int64_t stamp_ns;
    const struct track_detection *detections; /* [n], n <= TRACK_DETECTIONS */
    size_t n;
    double fresh;       /* part of the image that is not in the one before, 0..1 */
    double span_s;      /* from its oldest ping to its newest: what has come out since is
                           not in all of them; 0: they are at one instant */
    double clutter_m2;  /* false detections for each square metre */
    bool standing_left; /* what stands, or the hole that it left, is in the image: tracks
                           have to move by themselves */
    bool settling; /* it was until a moment ago: what is left of it may still be there */
    struct track_array array;
    struct ego_step ego; /* since the scan before */
    bool ego_known;
    struct track_mirror mirrors[TRACK_MIRRORS]; /* [n_mirrors]: all that are known now */
    size_t n_mirrors;
    /* The mirror that stands before what is imaged there (vehicle frame): its index, or
     * n_mirrors.  NULL: none does. */
    size_t (*stands_before)(const void *context, const double imaged_m[3]);
    /* Does the image show this place (vehicle frame)?  NULL: all. */
    bool (*shows)(const void *context, const double p_m[3]);
    const void *context;
};

enum track_state { TRACK_NEW, TRACK_MEASURED, TRACK_PREDICTED, TRACK_DELETED };
enum track_motion { TRACK_MOTION_UNKNOWN, TRACK_STANDING, TRACK_MOVING };

struct track_report {
    unsigned id;
    enum track_state state;
    double position_m[3], covariance_m2[6]; /* of its middle (track_outline.h) */
    double heard_m[3];                      /* the middle of what is heard of it */
    bool placed; /* else all of these are where it is imaged, or would be */
    struct track_mirror mirror;                /* that they hold for */
    double velocity_m_s[2], velocity_m2_s2[3]; /* over ground; covariance xx xy yy */
    double extent_m[3];
    double existence; /* of what is predicted: within a metre of its place */
    enum track_motion motion;
    double age_s, unseen_s; /* since it was seen first, last */
    size_t detection;       /* the strongest of its own in this scan; n: none */
};

struct track_counts {
    uint64_t late;    /* scans older than the newest, ignored */
    uint64_t resets;  /* after stamps that went far back */
    uint64_t crowded; /* objects that found no free track, or no free id */
    uint64_t jumped;  /* tracks that a mirror moved by more than was not known of it */
};

/* Where a place is imaged by way of a mirror, or what is imaged there really is. */
void track_mirror_point(const struct track_mirror *m, const double p[3], double out[3]);

/* One that stands still, in the frame of the vehicle after a step. */
struct track_mirror track_mirror_after(const struct ego_step *step,
                                       const struct track_mirror *m);

struct tracker;

/* 0, -EINVAL (a value out of its range), -ENOMEM.  Nothing is allocated later. */
int tracker_create(struct tracker **out, const struct track_config *cfg);

/* 0, or -ESTALE: not newer than the newest, nothing is done.  64 tracks and detections:
 * a millisecond. */
int tracker_step(struct tracker *t, const struct track_scan *scan);

/* The confirmed ones after a step, and those that ended in it, the likeliest first. */
size_t tracker_report(const struct tracker *t, struct track_report out[TRACKS_MAX]);
struct track_counts tracker_counts(const struct tracker *t);
void tracker_destroy(struct tracker *t);

#endif
