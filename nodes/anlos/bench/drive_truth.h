/* nodes/anlos/bench/drive_truth.h -- who is really there at a time of a drive. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_TRUTH_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_TRUTH_H

#include "hal/room/room.h"

struct drive_truth {
    /* out[max]; returns how many there are. */
    size_t (*at)(const void *context, double t_s, struct room_truth *out, size_t max);
    const void *context; /* not owned */
};

/* A simulated room at world time t_s. */
struct drive_truth drive_truth_room(const struct room *r);

#endif
