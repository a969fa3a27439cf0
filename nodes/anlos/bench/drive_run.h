/* nodes/anlos/bench/drive_run.h -- one simulated drive from its beginning to its end. */
#ifndef ANLOS_NODES_ANLOS_BENCH_DRIVE_RUN_H
#define ANLOS_NODES_ANLOS_BENCH_DRIVE_RUN_H

#include <stdint.h>

#include "nodes/anlos/bench/drive_moments.h"
#include "nodes/anlos/bench/drive_result.h"
#include "nodes/rt/launchfile.h"

struct drive_run { /* borrows */
    const struct launchfile *launch;
    const char *scene; /* file */
    uint32_t draw;     /* room_load_drawn */
    size_t rounds, threads;
};

struct drive_outcome {
    int err; /* 0, -EINTR (result and moments are of what was done), negative errno */
    struct complaint why;
    struct drive_result result;
    struct drive_moments moments; /* free() its at */
};

void drive_run(const struct drive_run *r, struct drive_outcome *out);

#endif
