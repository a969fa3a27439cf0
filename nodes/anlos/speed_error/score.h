/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/score.h -- how wrong an image is.  The definitions are those of
 * the reference simulator's metrics (independent code):
 *
 * Points.  Each one's peak is the brightest voxel within 12 cm of it across and 12 cm in
 * depth, refined on each axis by a parabola through the logarithm of the intensity of
 * three voxels.  Lateral and depth error are against the truth; widths are those of the
 * line of voxels through the peak at a quarter of its intensity (-6 dB), between voxels
 * by straight lines.  The sidelobe ratio is that of the faintest peak over the brightest
 * voxel that is farther than 15 cm across or 10 cm in depth from every point.
 *
 * Letters.  The largest intensity within 15 cm of each letter's depth, interpolated
 * linearly to a grid of 1 cm inside the array's footprint; its root is the picture.
 * Correlation is that of picture and mask, both less their mean.  IoU is the best
 * intersection over union of the mask and {picture > t of its maximum}, t = .02 ... .98.
 */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_SCORE_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_SCORE_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "recon/grid.h"

/* What is really there in a recording that `anlos speed-error` images: points, or flat
 * letters before the array.  All in the array frame, as mirrored at the wall. */

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

/* 0, or -E2BIG (an error names the limit). */
int bench_truth_add_point(struct bench_truth *t, const double at_m[3], struct error *why);
int bench_truth_add_mask(struct bench_truth *t, const struct bench_mask *m,
                         struct error *why);

/* A letter of hal/room/scatter.h: bars of one stroke in a box.  0, -EINVAL (no such). */
int bench_mask_letter(struct bench_mask *m, char letter, const double size_m[2],
                      double stroke_m);

struct bench_score {                   /* NaN: what is not known of this kind of truth */
    double lateral_m, lateral_worst_m; /* mean and largest over the points */
    double depth_m;                    /* mean of the magnitudes */
    double width_m[3];                 /* median over the points */
    double sidelobe_db;                /* worst: the faintest peak over it */
    double iou, correlation;
};

/* The one number that is drawn: lateral error in cm of points, 1 - IoU of letters. */
double bench_score_error(const struct bench_score *s);

/* Points if there are any, else letters, within window_m (x from, to, y from, to; of
 * letters only).  intensity [nz][ny][nx].  0, -EINVAL (no truth), -ENOMEM. */
int bench_score(struct bench_score *out, const struct bench_truth *truth,
                const double window_m[4], const struct grid *grid,
                const float *intensity);

/* The window of letters inside an array's footprint. */
void bench_score_window(double window_m[4], const struct geometry *g);

#endif
