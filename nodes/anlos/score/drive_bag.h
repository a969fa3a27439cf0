/* SPDX-License-Identifier: MIT */
/* nodes/anlos/score/drive_bag.h -- the tracks of a recorded drive, as they were recorded:
 * what the vehicle was told, when it was told. */
#ifndef ANLOS_NODES_ANLOS_SCORE_DRIVE_BAG_H
#define ANLOS_NODES_ANLOS_SCORE_DRIVE_BAG_H

#include "hal/room/room.h"
#include "msgs/survey.pb-c.h"
#include "msgs/vehicle.pb-c.h"
#include "msgs/wall.pb-c.h"
#include "nodes/anlos/score/drive_score.h"
#include "nodes/anlos/score/drive_truth_file.h"
#include "recon/survey.h"
#include "recon/walls/walls.h"

/* scene: of a simulated drive, whose time the clock tells; else truth, which lies in the
 * vehicle frame of each instant; the bag's walls and motion (topics wall, ego) tell what
 * of that is in the gate and how fast it is over ground.  When it came into view is not
 * known then.
 * *out also of a part, when it is interrupted: out->err is -EINTR. */
void drive_bag(const char *bag, const struct room *scene, const struct truth_file *truth,
               struct drive_outcome *out);

/* The surroundings of a recorded drive: who is there at a time, by a scene or a file of
 * truth with what the bag says of walls and of the vehicle. */

struct drive_bag_world {
    const struct room *scene; /* one of the two; not owned */
    const struct truth_file *truth;
    struct survey survey;
    bool has_survey;
    int64_t begin_ns; /* stamp of time 0 */
    struct bag_ego {
        int64_t ns;
        struct ego_motion motion;
    } * ego; /* [n_ego], in the order of their stamps */
    size_t n_ego, ego_room;
    struct bag_wall {
        int64_t ns;
        bool is; /* there is one */
        struct wall plane;
    } * walls; /* [n_walls] */
    size_t n_walls, walls_room;
};

/* Each takes a message of the bag; what came late is left out.  0, -EINVAL, -ENOMEM. */
int drive_bag_world_survey(struct drive_bag_world *w, const Anlos__Survey *m,
                           struct error *why);
int drive_bag_world_ego(struct drive_bag_world *w, const Anlos__EgoMotion *m, int64_t ns,
                        struct error *why);

/* How the vehicle moved at a time: the newest that was heard by then, or the first; it
 * stood, where nothing was. */
struct ego_motion drive_bag_world_motion(const struct drive_bag_world *w, int64_t ns);

/* At times of that; borrows w. */
struct drive_truth drive_bag_world_truth(const struct drive_bag_world *w);
void drive_bag_world_clear(struct drive_bag_world *w);

#endif
