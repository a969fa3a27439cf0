/* nodes/anlos/bench/drive_bag.h -- the tracks of a recorded drive, as they were recorded:
 * what the vehicle was told, when it was told. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_BAG_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_BAG_H

#include "hal/room/room.h"
#include "nodes/anlos/bench/drive_run.h"
#include "nodes/anlos/bench/drive_truth_file.h"

/* scene: of a simulated drive, whose time the clock tells; else truth, which lies in the
 * vehicle frame of each instant; the bag's walls and motion (topics wall, ego) tell what
 * of that is in the gate and how fast it is over ground.  When it came into view is not
 * known then.
 * *out also of a part, when it is interrupted: out->err is -EINTR. */
void drive_bag(const char *bag, const struct room *scene, const struct truth_file *truth,
               struct drive_outcome *out);

#endif
