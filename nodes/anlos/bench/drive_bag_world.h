/* nodes/anlos/bench/drive_bag_world.h -- the surroundings of a recorded drive: who is
 * there at a time, by a scene or a file of truth with what the bag says of walls and of
 * the vehicle. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_BAG_WORLD_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_BAG_WORLD_H

#include "msgs/wall.pb-c.h"
#include "msgs/survey.pb-c.h"
#include "recon/survey.h"
#include "msgs/vehicle.pb-c.h"
#include "nodes/anlos/bench/drive_truth.h"
#include "nodes/anlos/bench/drive_truth_file.h"
#include "recon/walls.h"

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
                           struct complaint *why);
int drive_bag_world_ego(struct drive_bag_world *w, const Anlos__EgoMotion *m, int64_t ns,
                        struct complaint *why);
int drive_bag_world_walls(struct drive_bag_world *w, const Anlos__WallList *m, int64_t ns,
                          struct complaint *why);

/* Time since begin_ns. */
double drive_bag_world_s(const struct drive_bag_world *w, int64_t ns);

/* At times of that; borrows w. */
struct drive_truth drive_bag_world_truth(const struct drive_bag_world *w);
void drive_bag_world_clear(struct drive_bag_world *w);

#endif
