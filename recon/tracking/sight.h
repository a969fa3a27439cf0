/* SPDX-License-Identifier: MIT */
/* recon/tracking/sight.h -- between what an image shows, in the array frame and mirrored,
 * and where that is for the vehicle. */
#ifndef ANLOS_RECON_TRACKING_SIGHT_H
#define ANLOS_RECON_TRACKING_SIGHT_H

#include <stdbool.h>
#include <stdint.h>

#include "recon/grid.h"
#include "recon/survey.h"
#include "recon/tracking/track.h"
#include "recon/walls/walls.h"

struct sight {
    const struct walls *walls;
    const struct walls *lost; /* known until lately, and none stands there now */
    const struct grid *grid;
    double axes[3][3], origin_m[3]; /* q = axes p + origin: array to vehicle frame */
};

/* Borrows walls, lost and grid. */
void sight_init(struct sight *s, const struct survey *survey, const struct walls *walls,
                const struct walls *lost, const struct grid *grid);

/* Which lost wall mirrored what is imaged here, in the array frame?  Its index, or how
 * many there are: a wall that is known did, or none. */
size_t sight_lost(const struct sight *s, const double virtual_m[3]);

/* The walls as mirrors of tracks, in the vehicle frame; returns how many. */
size_t sight_mirrors(const struct sight *s, struct track_mirror out[TRACK_MIRRORS]);

/* Where a place of the vehicle frame is imaged by way of a mirror. */
void sight_virtual(const struct sight *s, const struct track_mirror *mirror,
                   const double p_m[3], double virtual_m[3]);

/* Which wall stands before what is imaged at a place of the vehicle frame?  Its index, or
 * how many there are: none does, or first a lost one.  As track_scan wants it; context: a
 * struct sight. */
size_t sight_stands_before(const void *context, const double imaged_m[3]);

/* Does the image show this place of the vehicle frame, by way of a wall where any is
 * known?  The way to its mirror image has to cross that wall between its ends: what is
 * heard past them, directly, is no object of a tracker (object_tracker.h), so that who
 * walks there is out of view.  Heights do not count.  As track_scan wants it; context: a
 * struct sight. */
bool sight_shows(const void *context, const double p_m[3]);

/* How likely it is that there is a wall of this id, 0..1; 1 of none. */
double sight_existence(const struct sight *s, uint32_t wall);

/* The direction, in the plane of the vehicle frame, in which the array hears a place by
 * way of a wall: away from where the array's own mirror image stands. */
void sight_direction(const struct sight *s, uint32_t wall, const double p_m[3],
                     double out[2]);

/* A small way in the image, array frame, as it is by way of a wall in the plane of the
 * vehicle frame. */
void sight_way(const struct sight *s, uint32_t wall, const double way_m[3],
               double out[2]);

/* How far behind a wall something is imaged; INFINITY of no wall. */
double sight_behind_m(const struct sight *s, uint32_t wall, const double virtual_m[3]);

/* What the wall's own error does to a place that is imaged at virtual_m: covariance in
 * the vehicle frame, xx xy xz yy yz zz; all 0 where the wall is exact or none. */
void sight_wall_error(const struct sight *s, uint32_t wall, const double virtual_m[3],
                      double covariance_m2[6]);

#endif
