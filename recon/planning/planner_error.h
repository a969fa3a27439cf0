/* SPDX-License-Identifier: MIT */
/* recon/planning/planner_error.h -- how wrong an image will be: standard deviation of a
 * small object's position across the line of sight, the worst of the strong ones; the
 * root of the sum of squares of
 *
 *   noise     width / sqrt(8 ln 4 SNR)            (Cramer-Rao, the image's own SNR)
 *   elements  sigma R sqrt(12 / N) / D            (N elements over an aperture D)
 *   moveout   `fast` without dip moveout: moveout_error.h; an image that falls
 *             apart: width / 4; with it, of every second or fourth speaker, what these
 *             add, times rms phase / 0.2 rad, 1 at most   (measured at 0.75 to 2.8 m)
 *   steps     0.17 step^3 / width^2               (peak between voxels; measured)
 *   planes    tilt x step in depth / sqrt(12)     (peak between planes: psf_tilt.h)
 *   power     `incoherent`: 0.03 of its width     (measured)
 *
 * and, where something has a shape,
 *
 *   edges     0.04 width, times what the pairs' aperture is smaller for, and the cube of
 *             what the mean frequency is lower for; `iterative`: three quarters of it
 *             (measured)
 *
 * That is sharpened; if not, moveout and planes count 1.5 times, edges 1.2, and steps, of
 * a point by `fast`, 0.75 (measured, over shifts of the grid).  Mirrors answer straight
 * ahead: moveout and planes do not count for them, and half for other shapes (measured).
 * Where nothing is known of the scene it may hold points or such shapes, and neither
 * error is to be many times what it need be: their geometric mean, a point's with 0.03
 * width, so that what is small enough weighs no more. */
#ifndef ANLOS_RECON_PLANNING_PLANNER_ERROR_H
#define ANLOS_RECON_PLANNING_PLANNER_ERROR_H

#include "recon/planning/planner.h"

/* Exponent of `fast` (recon/coherent/fk.h) where it is used.  Measured: a third off the
 * error of points aside, a sixth off that of letters, 2 dB more sidelobes; a point
 * straight ahead is read half as wrong again between voxels. */
#define PLANNER_SHARPEN 2.5

#define PLANNER_GOAL 0.0055 /* of a point's width: an error that is small enough */

/* Across the line of sight, the larger one that is resolved; 0: none. */
double planner_width_m(const struct probe_object *o);

/* The strongest object, or what is assumed. */
const struct probe_object *planner_object(const struct probe *probe);

/* Something mirror-like and larger than a point. */
bool planner_sees_shape(const struct probe *probe);

/* Of its step in depth, times that of the whole image. */
double planner_depth_step(const struct planner_candidate *c);

/* Fills in error_m and own_m. */
void planner_estimate_error(const struct planner_config *cfg,
                            struct planner_candidate *c);

#endif
