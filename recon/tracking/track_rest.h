/* SPDX-License-Identifier: MIT */
/* recon/tracking/track_rest.h -- does a track show one scatterer at rest, or something
 * that moves?
 *
 * A line array hears how far a thing is along its axis, u (x - p), and how far it is from
 * the array, |x - p|; not in which direction across the axis.  A thing over the array,
 * under it or behind it, heard directly, is imaged in the plane all the same: beyond the
 * wall, where it seems to glide over ground as soon as the vehicle moves.  But wherever
 * a scatterer rests, in space and reflected or not,
 *
 *   u x           = u p + along
 *   h - 2 p x     = range^2 - |p|^2,    h = |x|^2 with its height,
 *
 * are linear in the three unknowns x (over ground) and h.  They are fitted by weighted
 * least squares over the newest seconds; what is left tells how far it is from rest.
 * (h < |x|^2 would be a height of an imaginary size: it is allowed, and costs a little of
 * the test's power along the way of the vehicle.)
 *
 * What moves with a velocity v was at x - v t and had h - b t + c t^2 a time t ago, with
 * b = 2 x v and c = |v|^2: four unknowns more, linear as well.  It has moved by itself
 * where these take away much of what rest leaves, and leave little.  Several things at
 * rest that are heard in turn fit no rest either, but motion explains them no better. (So
 * an F-test compares two nested linear models in noise whose strength is not known: Kay
 * 1998, "Fundamentals of Statistical Signal Processing: Detection Theory", chapter 9.) */
#ifndef ANLOS_RECON_TRACKING_TRACK_REST_H
#define ANLOS_RECON_TRACKING_TRACK_REST_H

#include <stdbool.h>
#include <stdint.h>

#define TRACK_REST_MISFIT 0.1  /* below: it seems to rest; above, the less the more */
#define TRACK_REST_GATE2  13.8 /* 999 of 1000 looks at a thing at rest are nearer */

enum { TRACK_REST_AT_REST = 3, TRACK_REST_UNKNOWNS = 7 }; /* x, h; then v, b, c */

struct track_rest_look {
    double array_m[2]; /* over ground, when it was heard */
    double axis[2];    /* of the array, unit */
    double along_m;    /* of the array's middle */
    double range_m;
    double sigma_m; /* of both */
};

struct track_rest {
    double origin_m[2]; /* over ground: all is counted from there */
    double normal[TRACK_REST_UNKNOWNS][TRACK_REST_UNKNOWNS]; /* at the newest look */
    double right[TRACK_REST_UNKNOWNS], squares;
    double looks;      /* fitted, old ones faded; 0: none */
    unsigned n_looks;  /* that were added */
    int64_t newest_ns; /* of them */
};

/* A look at something else: far from where a scatterer rests that explains the others;
 * the farther, the worse it explains them. */
bool track_rest_jumps(const struct track_rest *r, const struct track_rest_look *look);

/* share: how much of a look this is, as far as it tells anything new; stamp_ns: no older
 * than the one before; memory_s: after which of what came before 1/e counts. */
void track_rest_add(struct track_rest *r, const struct track_rest_look *look,
                    double share, int64_t stamp_ns, double memory_s);

/* Sum of the squares that are left, in units of their variances, over what a scatterer at
 * rest would leave in one of ten million cases. */
double track_rest_misfit(const struct track_rest *r);

/* Of the squares that rest leaves, those that motion explains and those that it leaves,
 * in units of their variances. */
void track_rest_motion(const struct track_rest *r, double *gain, double *left);

/* It has moved by itself, steadily.  rest_is_rare: what is at rest was taken away from
 * what is looked at, and only its remains are left; phases_agree: its velocity by the
 * phases of pings is that of its places, which several things heard in turn do not
 * show. */
bool track_rest_moves(const struct track_rest *r, bool rest_is_rare, bool phases_agree);

/* How far a look is from where the scatterer would be heard at rest: squares in units of
 * their variances, of two degrees of freedom. */
double track_rest_distance2(const struct track_rest *r,
                            const struct track_rest_look *look);

#endif
