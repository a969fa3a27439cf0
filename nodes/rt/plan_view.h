/* SPDX-License-Identifier: MIT */
/* nodes/rt/plan_view.h -- the plan view: what stands where, seen from above, in metres to
 * the right and ahead.  In the vehicle frame (x forward, y left) that is (-y, x); where
 * no mount is known, in the array frame (x along the stage, z to the wall), it is (x, z).
 */
#ifndef ANLOS_NODES_RT_PLAN_VIEW_H
#define ANLOS_NODES_RT_PLAN_VIEW_H

#include <stdbool.h>

#include "recon/grid.h"
#include "recon/survey.h"
#include "recon/walls/wall.h"

/* A point of the vehicle's or the array's frame on the plan. */
void plan_point(bool in_vehicle_frame, const double p[3], double out[2]);

/* The ellipse that holds a share of 95 % of a normal distribution (radii 2.448 standard
 * deviations): half axes, 2 m at most, for what is not known has no end, and the angle of
 * the longer one to "right", counterclockwise.
 */
struct plan_ellipse {
    double major_m, minor_m, angle_rad;
};

/* covariance: xx xy xz yy yz zz, of the vehicle's or the array's frame. */
void plan_ellipse(bool in_vehicle_frame, const double covariance_m2[6],
                  struct plan_ellipse *out);

/* The wall's line on the plan at the height of the array: a point of it next to the array
 * and its direction.  false: it has none (a ceiling). */
bool plan_wall(const struct survey *s, const struct wall *wall, double point[2],
               double direction[2]);

/* The corners of what an image covers, where it really is, from that of voxel [0][][0],
 * along x first.  wall NULL: none is known; where it is imaged. */
void plan_footprint(const struct survey *s, const struct wall *wall,
                    const struct grid *grid, double corners[4][2]);

#endif
