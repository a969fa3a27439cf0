/* SPDX-License-Identifier: MIT */
/* recon/walls/field_of_view.h -- which areas of the floor are seen, and by way of which
 * wall.
 *
 * In the array's plane (x, z): between two directions in which a wall ends, or two walls
 * meet, one wall is hit first.  What the image holds there behind it is mirrored by it,
 * and seen where no other wall stands in the way back.  All areas are convex, and claim
 * less rather than more: a circle of the greatest range is cut by chords, one of the
 * least by a straight line, and of more than VIEW_CORNERS corners those that cost the
 * least area are left out.  Walls count as upright and as exact, and heights do
 * not count, as in sight_shows. */
#ifndef ANLOS_RECON_WALLS_FIELD_OF_VIEW_H
#define ANLOS_RECON_WALLS_FIELD_OF_VIEW_H

#include <stddef.h>
#include <stdint.h>

#include "recon/grid.h"
#include "recon/survey.h"
#include "recon/walls/wall.h"

#define VIEW_CORNERS 8
#define VIEW_AREAS   15

struct view_area { /* a convex polygon */
    uint32_t wall; /* 0: seen directly, through a gap between walls or where none is */
    size_t n;      /* 3..VIEW_CORNERS */
    double corners_m[VIEW_CORNERS][2]; /* x, y of the vehicle frame, counterclockwise; of
                                          a survey without a mount x, z of the array's */
};

struct field_of_view {
    size_t n;
    struct view_area areas[VIEW_AREAS]; /* from one side of the array to the other */
};

/* walls[n_walls], in the array frame: the first n_mirrors show what they mirror, the
 * others only stand in the way.  What is farther from the array than far_m (half a path)
 * is not seen; INFINITY: the image and the walls' gates alone bound it.  Of more than
 * VIEW_AREAS areas the last ones are left out. */
void field_of_view_find(struct field_of_view *out, const struct survey *s,
                        const struct wall_gate *walls, size_t n_walls, size_t n_mirrors,
                        const struct grid *grid, double far_m);

#endif
