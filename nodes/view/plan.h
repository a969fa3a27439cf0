/* nodes/view/plan.h -- the plan view: what stands where, seen from above, in metres to
 * the right and ahead.  In the vehicle frame (x forward, y left) that is (-y, x); where
 * no mount is known, in the array frame (x along the stage, z to the wall), it is (x, z).
 */
#ifndef ANLOS_NODES_VIEW_PLAN_H
#define ANLOS_NODES_VIEW_PLAN_H

#include <jansson.h>

#include "msgs/detections.pb-c.h"
#include "msgs/survey.h"
#include "recon/grid.h"

/* A point of the vehicle's or the array's frame on the plan. */
void plan_point(bool in_vehicle_frame, const double p[3], double out[2]);

/* The ellipse that holds a share of 95 % of a normal distribution (radii 2.448 standard
 * deviations): half axes, and the angle of the longer one to "right", counterclockwise.
 */
struct plan_ellipse {
    double major_m, minor_m, angle_rad;
};

/* covariance: xx xy xz yy yz zz, of the vehicle's or the array's frame. */
void plan_ellipse(bool in_vehicle_frame, const double covariance_m2[6],
                  struct plan_ellipse *out);

/* The wall's line on the plan at the height of the array: a point of it next to the array
 * and its direction.  false: it has none (a ceiling, or no wall is known). */
bool plan_wall(const struct survey *s, double point[2], double direction[2]);

/* "scene": frame, source, wall, array, air. */
json_t *plan_scene_json(const struct survey *s);

/* "objects" of a list of detections. */
json_t *plan_objects_json(const Anlos__DetectionList *list);

/* The corners of what an image covers, where it really is: [[right, ahead], ...] of 4. */
json_t *plan_footprint_json(const struct survey *s, const struct grid *grid);

#endif
