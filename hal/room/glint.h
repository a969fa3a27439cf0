/* SPDX-License-Identifier: MIT */
/* hal/room/glint.h -- bodies that are heard by the side that faces the array: each of
 * their parts an ellipsoid, or a piece of one, hard and smooth against the wavelength.
 *
 * Such a part is heard by its glint alone, the point whose normal halves the angle
 * between the ways in and out (geometric acoustics; the way by it is the shortest).  With
 * r the way in, s the way out and R1, R2 its radii of curvature there, that is as strong
 * as a scattering length of 1 / sqrt((1/r + 1/s + 2/R1) (1/r + 1/s + 2/R2)) (Keller 1962,
 * "Geometrical theory of diffraction", Eq. 2, at small angles): sqrt(R1 R2) / 2 of what
 * is far away, a mirror's r s / (r + s) of what is flat.  It slides over the body as that
 * moves.  What bends around edges and into shadows is left out. */
#ifndef ANLOS_HAL_ROOM_GLINT_H
#define ANLOS_HAL_ROOM_GLINT_H

#include <stdbool.h>
#include <stddef.h>

struct glint_part {
    double half_axes[3][3]; /* at right angles; all 0: no part, but a point */
    double from[3], to[3];  /* which piece of it there is: along each half-axis, over its
                               length, -1..1 of a whole one */
};

bool glint_is_part(const struct glint_part *p);

/* All of an ellipsoid, which can hide what is behind it. */
bool glint_is_whole(const struct glint_part *p);

/* Where a part at `centre` is heard by way from a to b; false: that point is none of the
 * piece. */
bool glint_find(const struct glint_part *p, const double centre[3], const double a[3],
                const double b[3], double at[3], double *scattering_length_m);

/* Does a whole one stand between two points? */
bool glint_hides(const struct glint_part *p, const double centre[3], const double a[3],
                 const double b[3]);

#endif
