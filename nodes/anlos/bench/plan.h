/* nodes/anlos/bench/plan.h -- which runs `anlos bench speed-error` makes of a method:
 * a base point, and one parameter varied at a time; of `fast`, also a small product; of
 * `auto`, its goals. */
#ifndef ANLOS_NODES_ANLOS_BENCH_PLAN_H
#define ANLOS_NODES_ANLOS_BENCH_PLAN_H

#include "nodes/anlos/bench/case.h"

#define BENCH_MAX_CASES 64

/* out [BENCH_MAX_CASES], from the cheap to the dear, so that the first tell what the
 * others will take; returns how many.  threads: at most. */
size_t bench_plan(struct bench_case *out, const char *method, size_t threads, bool quick);

/* The same method at 1, 4 and 16 times the work: in voxels with all pairs (varied
 * "growth, voxels"), then in pairs on the base grid ("growth, pairs").  out [6]. */
#define BENCH_GROWTH_CASES 6
void bench_plan_growth(struct bench_case *out, const char *method, size_t threads);

/* How many times the least work of its kind a growth case is. */
double bench_plan_work(const struct bench_case *c);

#endif
