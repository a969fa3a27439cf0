/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/results.h -- the runs of `anlos speed-error` as they
 * come: a line of CSV each, kept for the table and the charts. */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_RESULTS_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_RESULTS_H

#include <stdio.h>

#include "nodes/anlos/speed_error/case.h"

struct bench_results {
    struct bench_result *r; /* [n] */
    size_t n, room;
    FILE *csv;
};

/* Begins FOLDER/speed-error.csv.  0 or a negative errno. */
int bench_results_open(struct bench_results *b, const char *folder, struct error *why);

/* Adds one; its line is in the file when this returns.  0 or a negative errno. */
int bench_results_add(struct bench_results *b, const struct bench_result *r,
                      struct error *why);

/* front[n] of the runs of one scene: done, and none that is done is both faster and less
 * wrong.  Growth is not in it. */
void bench_results_front(const struct bench_results *b, const char *scene, bool *front);

/* `fast` of a scene at its base point.  NULL: it was not run. */
const struct bench_result *bench_results_fast(const struct bench_results *b,
                                              const char *scene);

/* What `auto` is to be held against: in the time of `fast`, that; else the least error of
 * all runs of `fast` of its scene that took at most as long.  NULL: none did. */
const struct bench_result *bench_results_rival(const struct bench_results *b,
                                               const struct bench_result *r);

/* Is it one that charts of error over time show? */
bool bench_result_counts(const struct bench_result *r, const char *scene);

void bench_results_close(struct bench_results *b);

/* Which runs `anlos speed-error` makes of a method: a base point, and one
 * parameter varied at a time; of `fast`, also a small product; of `auto`, its goals. */

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
