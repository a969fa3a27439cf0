/* nodes/anlos/bench/truth.h -- what is really there in a recording that `anlos bench`
 * images: points, or flat letters before the array.  All in the array frame, as mirrored
 * at the wall. */
#ifndef ANLOS_NODES_ANLOS_BENCH_TRUTH_H
#define ANLOS_NODES_ANLOS_BENCH_TRUTH_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/complaint.h"

#define BENCH_MAX_POINTS 32
#define BENCH_MAX_MASKS  8
#define BENCH_MAX_BARS   4

struct bench_mask { /* a letter as bars around its centre, in a plane z */
    double z_m, centre_m[2];
    size_t n_bars;
    double bars_m[BENCH_MAX_BARS][4]; /* x from, x to, y from, y to; from the centre */
};

struct bench_truth {
    size_t n_points, n_masks; /* where there are points, they are what counts */
    double points_m[BENCH_MAX_POINTS][3];
    struct bench_mask masks[BENCH_MAX_MASKS];
};

/* Depths between which all of it lies.  false: there is nothing. */
bool bench_truth_depth(const struct bench_truth *t, double z_m[2]);

/* Is (x, y) on one of the letters? */
bool bench_truth_covers(const struct bench_truth *t, double x_m, double y_m);

/* 0, or -E2BIG (a complaint names the limit). */
int bench_truth_add_point(struct bench_truth *t, const double at_m[3],
                          struct complaint *why);
int bench_truth_add_mask(struct bench_truth *t, const struct bench_mask *m,
                         struct complaint *why);

/* A letter of hal/room/scatter.h: bars of one stroke in a box.  0, -EINVAL (no such). */
int bench_mask_letter(struct bench_mask *m, char letter, const double size_m[2],
                      double stroke_m);

#endif
