/* SPDX-License-Identifier: MIT */
/* nodes/anlos/stopwatch.h -- wall and CPU time of the stages of a command. */
#ifndef ANLOS_NODES_ANLOS_STOPWATCH_H
#define ANLOS_NODES_ANLOS_STOPWATCH_H

#include <stdbool.h>

struct stopwatch {
    double wall_s, cpu_s;
};

/* Now; own_thread: CPU time of the calling thread, else of the whole process. */
struct stopwatch stopwatch_now(bool own_thread);

/* *total += what has passed since *since, and *since = now. */
void stopwatch_lap(struct stopwatch *total, struct stopwatch *since, bool own_thread);

#endif
