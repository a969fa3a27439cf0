/* nodes/anlos/bench/score.h -- how wrong an image is.  The definitions are those of the
 * reference simulator's metrics (independent code):
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
#ifndef ANLOS_NODES_ANLOS_BENCH_SCORE_H
#define ANLOS_NODES_ANLOS_BENCH_SCORE_H

#include "nodes/anlos/bench/truth.h"
#include "recon/grid.h"

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
