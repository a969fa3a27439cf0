/* SPDX-License-Identifier: MIT */
/* hal/room/figure.h -- persons, cyclists and cars as a dozen points or two that move as
 * their limbs do.
 *
 * How strong: a hard convex body, large against the wavelength and seen from anywhere,
 * scatters back as if it spread the sound that hits its shadow evenly; its mean shadow is
 * a quarter of its surface (Cauchy 1841), so the scattering length is
 *   a = sqrt(reflected part x surface / (16 pi)).
 * A person of 1.75 m and 75 kg has 1.9 m2 (Du Bois and Du Bois 1916); clothes take about
 * half of the sound above 2 kHz (Kuttruff, Room Acoustics, table of audiences): 0.14 m.
 * With a bicycle, tubes and rims of some 1 m2: 0.2 m.  A car, 30 m2 of metal and glass:
 * 0.8 m, of the panels that look at the array.  The points' squares add up to that; how
 * they interfere is up to the aspect, as with real bodies.
 *
 * Opaque, a body is what it is made of: head, trunk and limbs that hide each other, or
 * the panels of a car, each heard by the side that faces the array (hal/room/glint.h);
 * clothes take half of the sound. */
#ifndef ANLOS_HAL_ROOM_FIGURE_H
#define ANLOS_HAL_ROOM_FIGURE_H

#include <stdbool.h>
#include <stddef.h>

#include "hal/room/glint.h"
#include "hal/room/scatter.h"

#define FIGURE_PERSON_M 0.14 /* scattering length */
enum { FIGURE_MAX = 32 };    /* pieces of any body */

/* How many pieces it has, by enum scene_kind, up to FIGURE_MAX; 0: it is not a body. */
size_t figure_size(int kind, bool opaque);

/* Its scattering length. */
double figure_scattering_length_m(int kind);

struct figure_pose {
    double centre_m[3];
    double heading[3], up[3]; /* unit, at right angles */
    double walked_m;          /* swings the limbs */
};

/* out[figure_size]: the points; scattering_length_m: of all of it. */
void figure_set(int kind, const struct figure_pose *pose, double scattering_length_m,
                struct scatter_piece *out);

/* The same of an opaque one: a piece is a part, whose weight is what it reflects, or a
 * point. */
void figure_set_opaque(int kind, const struct figure_pose *pose,
                       double scattering_length_m, struct scatter_piece *out,
                       struct glint_part *parts);

/* Full size along the axes of the frame that the pose is in. */
void figure_extent(int kind, const struct figure_pose *pose, double out[3]);

#endif
