/* nodes/track/sight.h -- between what an image shows, in the array frame and mirrored,
 * and where that is for the vehicle. */
#ifndef ANLOS_NODES_TRACK_SIGHT_H
#define ANLOS_NODES_TRACK_SIGHT_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/survey.h"
#include "nodes/rt/walls.h"
#include "recon/grid.h"

struct sight {
    const struct walls *walls;
    const struct grid *grid;
    double axes[3][3], origin_m[3]; /* q = axes p + origin: array to vehicle frame */
};

/* Borrows walls and grid. */
void sight_init(struct sight *s, const struct survey *survey, const struct walls *walls,
                const struct grid *grid);

/* Where a place of the vehicle frame is imaged by way of a wall; 0, or an id that is not
 * there any more: directly. */
void sight_virtual(const struct sight *s, uint32_t wall, const double p_m[3],
                   double virtual_m[3]);

/* Does the image show this place of the vehicle frame?  Heights do not count.  As
 * track_scan wants it; context: a struct sight. */
bool sight_shows(const void *context, const double p_m[3]);

/* The direction, in the plane of the vehicle frame, in which the array hears a place by
 * way of a wall: away from where the array's own mirror image stands. */
void sight_direction(const struct sight *s, uint32_t wall, const double p_m[3],
                     double out[2]);

/* How far behind a wall something is imaged; INFINITY of no wall. */
double sight_behind_m(const struct sight *s, uint32_t wall, const double virtual_m[3]);

/* What the wall's own error does to a place that is imaged at virtual_m: covariance in
 * the vehicle frame, xx xy xz yy yz zz; all 0 where the wall is exact or none. */
void sight_wall_error(const struct sight *s, uint32_t wall, const double virtual_m[3],
                      double covariance_m2[6]);

#endif
