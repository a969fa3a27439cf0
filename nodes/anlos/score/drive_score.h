/* SPDX-License-Identifier: MIT */
/* nodes/anlos/score/drive_score.h -- lists of tracks of a drive against what is really
 * there.
 *
 * An object is to be found while its mirror image is in the gate and in the volume.  One
 * that is out of these, but there, makes no track false and is not missed.  Everything is
 * in the plane: heights are not resolved.  The place of an object is its middle; of one
 * longer than 0.6 m, of which an image shows parts, what is nearest to a track, no nearer
 * to its outline than 0.3 m.  A second track of it is false in GOSPA and OSPA, but is not
 * counted as a false track. */
#ifndef ANLOS_NODES_ANLOS_SCORE_DRIVE_SCORE_H
#define ANLOS_NODES_ANLOS_SCORE_DRIVE_SCORE_H

#include <stdbool.h>
#include <stddef.h>

#include "hal/room/room.h"
#include "msgs/can/frames.h"
#include "msgs/detections.pb-c.h"
#include "nodes/anlos/score/drive_result.h"
#include "nodes/can/sender.h"
#include "nodes/rt/launchfile.h"

/* How far a set of reported places is from the set of true ones, in the plane.
 *
 * GOSPA (Rahmathullah, Garcia-Fernandez and Svensson 2017, "Generalized optimal
 * sub-pattern assignment metric", with alpha = 2, Eq. 6): places are assigned to each
 * other where that is cheaper than a cutoff c, what is left over is missed or false,
 *
 *   ( sum over pairs d^p + c^p / 2 (missed + false) )^(1/p)
 *
 * OSPA (Schuhmacher, Vo and Vo 2008, "A consistent metric for performance evaluation of
 * multi-object filters", Eq. 3), n <= m the sizes of the sets:
 *
 *   ( 1/m ( least sum over n pairs min(d, c)^p + c^p (m - n) ) )^(1/p),  0 of empty sets
 */

#define BENCH_SET_MAX 64
#define BENCH_NOBODY  ((size_t)-1)

struct bench_set_distance {
    double gospa_m, ospa_m;
    double localisation; /* m^p, the three parts of GOSPA to the power p */
    double missed, false_ones;
    size_t n_missed, n_false;
    size_t match[BENCH_SET_MAX]; /* [n_truth] the index found, or BENCH_NOBODY */
};

/* truth_m [n_truth][2], found_m [n_found][2], each at most BENCH_SET_MAX; cutoff_m > 0,
 * order >= 1. */
void bench_set_distance(struct bench_set_distance *out, const double (*truth_m)[2],
                        size_t n_truth, const double (*found_m)[2], size_t n_found,
                        double cutoff_m, double order);

/* Who is really there at a time of a drive. */

struct drive_truth {
    /* out[max]; returns how many there are. */
    size_t (*at)(const void *context, double t_s, struct room_truth *out, size_t max);
    const void *context; /* not owned */
};

/* A simulated room at world time t_s. */
struct drive_truth drive_truth_room(const struct room *r);

#define DRIVE_CUTOFF_M 1.0 /* of GOSPA and OSPA: farther off it is another object */
#define DRIVE_ORDER    2.0
#define DRIVE_FAR_M    3.5 /* ranges from here on count as far */
#define DRIVE_OBJECTS  8
#define DRIVE_LIVES    1024

struct drive_object { /* by its place in the scene */
    char name[32];
    bool in_gate, confirmed, hidden_first; /* this time */
    double entered_s;
};

struct drive_life { /* of a track id */
    unsigned id;
    bool matched;
};

struct drive_score {
    struct drive_truth truth;
    double gate_m[2], volume_m[2][2]; /* x and z from, to */
    struct drive_object objects[DRIVE_OBJECTS];
    struct drive_life lives[DRIVE_LIVES]; /* those that are over and were false are */
    size_t n_lives;                       /* counted and dropped */
    double looked_s;                      /* up to here for objects that come in */
    double began_s;
    struct drive_result result;
};

/* The survey has gate and volume. */
void drive_score_init(struct drive_score *s, const struct drive_truth *truth,
                      const struct survey *survey, double began_s);

/* tracks: at world time t_s, and out in the world at out_s; detections: the same image's,
 * untracked.  NULL: not known; the tracks that were measured in this image stand in. */
void drive_score_list(struct drive_score *s, double t_s, double out_s,
                      const Anlos__DetectionList *tracks,
                      const Anlos__DetectionList *detections, struct drive_moment *m);

/* What the vehicle is told of lists of tracks: each goes through the can node's own step
 * into frames, and is read back from these. */

struct drive_told {
    struct sender sender;
    int64_t last_ns; /* when the list before went */
    struct can_object objects[CAN_MAX_OBJECTS];
    size_t n; /* of the newest list, also the deleted */
};

/* l NULL: the bus as it is by default. */
void drive_told_init(struct drive_told *t, const struct launchfile *l);
void drive_told_survey(struct drive_told *t, const Anlos__Survey *survey);

/* The list of the same image, which goes at now_ns: counts who is told, and how true that
 * is.  Errors are those of an object's middle. */
void drive_score_told(struct drive_score *s, struct drive_told *told, double t_s,
                      const Anlos__DetectionList *list, int64_t capture_ns,
                      int64_t now_ns);
void drive_score_end(struct drive_score *s);

#endif
