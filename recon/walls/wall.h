/* SPDX-License-Identifier: MIT */
/* recon/walls/wall.h -- the image shows mirrored objects; this puts them where they are,
 * with what is not known of the wall in what is not known of them.
 *
 * The error of a wall is that of three small numbers: two turns of its normal, about the
 * axes of wall_axes, and its distance.  To first order a turn by (a, b) moves the normal
 * by a (upright x normal) + b (level x normal), as any rotation vector does. */
#ifndef ANLOS_RECON_WALLS_WALL_H
#define ANLOS_RECON_WALLS_WALL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct wall { /* { p : normal . p = distance_m }, normal of length 1 */
    double normal[3];
    double distance_m;
    double covariance[6]; /* aa ab ad bb bd dd: turns about upright and level, rad, and
                             distance_m; all 0: known exactly */
    double ends_m[2];     /* from, to: along level, from the foot of the perpendicular
                             from the frame's origin; both 0: it is not known to end */
};

/* It ends where two points, in either order, are along it; to the micrometre, so that
 * what was written and is read again is the same.  false: they are one place of it. */
bool wall_end_at(struct wall *w, const double a[3], const double b[3]);

/* Is it known where it ends? */
bool wall_ends(const struct wall *w);

/* How far beyond the nearer end a point of it is, along it; negative between the ends. */
double wall_beyond_end_m(const struct wall *w, const double p[3]);

/* The whole matrix of a covariance: of a wall, or of a point (xx xy xz yy yz zz). */
void wall_unfold(const double c[6], double out[3][3]);

/* Two axes of length 1 in the plane: upright is the direction in it nearest to `up`, and
 * level = normal x upright, so that (upright, level, normal) is right-handed.  Where the
 * normal is within 1 degree of up, as a floor's, the x axis (or z) takes the place of up.
 * With normal = z and up = y: upright = y, level = -x. */
void wall_axes_about(const double normal[3], const double up[3], double upright[3],
                     double level[3]);

/* The same with up = y, as in the array frame; what covariance is about. */
void wall_axes(const struct wall *w, double upright[3], double level[3]);

/* The wall after turns of its normal by these angles and a change of its distance: the
 * rotation about the origin by the vector a upright + b level, exactly; its ends turn
 * with it.  The covariance stays. */
void wall_turn(const struct wall *w, const double change[3], struct wall *out);

/* The change that makes `to` of `from`: the inverse of wall_turn, for normals less than
 * half a turn apart. */
void wall_difference(const struct wall *from, const struct wall *to, double change[3]);

/* The wall in a frame of which q = r p + t, r [to][from] a rotation; up: of the frame
 * that it is in, in which its covariance and ends are meant (the result's are about y).
 * out may be w. */
void wall_move(const struct wall *w, const double up[3], const double r[3][3],
               const double t[3], struct wall *out);

/* Makes the normal point away from the frame's origin: distance_m >= 0.  The same wall.
 */
void wall_face(struct wall *w);

/* The mirror image of p. */
void wall_mirror(const struct wall *w, const double p[3], double out[3]);

/* The covariance (xx xy xz yy yz zz) of the mirror image of a point p with covariance c,
 * the wall's own, with its correlations, included: H c H' + J w J', where J is how the
 * image moves with turns and distance.  First order: for turns of a few degrees.  The
 * errors of wall and point are independent of each other. */
void wall_mirror_covariance(const struct wall *w, const double p[3], const double c[6],
                            double out[6]);

/* Does the line from one point to another cross the wall's plane, between its ends or
 * beyond, and how far along, 0..1? */
bool wall_crosses(const struct wall *w, const double from[3], const double to[3],
                  double *along);

struct wall_gate { /* a wall, and what is seen by way of it */
    uint32_t id;   /* from 1 */
    struct wall plane;
    double gate_m[2]; /* near, far: ranges from the array, half paths */
};

/* Which of n walls mirrored what is imaged at p, seen from a place: sound turns back at
 * the first wall on its straight way to the image, among those whose gate holds its
 * range.  Where none is crossed between its ends, one that is crossed less than
 * WALL_END_MARGIN_M beyond did: an array of 1 m looks past an end from half a metre on
 * either side, and at 2 to 20 kHz and some metres the Fresnel zone of a mirror is half a
 * metre to a fifth of that wide.  Their index, or n: none stands between. */
#define WALL_END_MARGIN_M 0.5
size_t wall_that_mirrored(const struct wall_gate *walls, size_t n, const double from[3],
                          const double p[3]);

#endif
