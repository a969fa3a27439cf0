/* recon/track_rest.h -- could what a track has shown be one scatterer at rest?
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
 * least squares over the newest seconds; what is left tells whether the thing has moved
 * by itself.  (h < |x|^2 would be a height of an imaginary size: it is allowed, and costs
 * a little of the test's power along the way of the vehicle.) */
#ifndef ANLOS_RECON_TRACK_REST_H
#define ANLOS_RECON_TRACK_REST_H

#include <stdbool.h>

#define TRACK_REST_MISFIT 0.1  /* below: it seems to rest; above, the less the more */
#define TRACK_REST_GATE2  13.8 /* 999 of 1000 looks at a thing at rest are nearer */

struct track_rest_look {
    double array_m[2]; /* over ground, when it was heard */
    double axis[2];    /* of the array, unit */
    double along_m;    /* of the array's middle */
    double range_m;
    double sigma_m; /* of both */
};

struct track_rest {
    double origin_m[2]; /* over ground: all is counted from there */
    double normal[3][3], right[3], squares;
    double looks;                  /* fitted, old ones faded; 0: none */
    unsigned n_looks;              /* that were added */
    struct track_rest_look newest; /* of them */
};

/* A look at something else: far from where a scatterer rests that explains the others;
 * the farther, the worse it explains them. */
bool track_rest_jumps(const struct track_rest *r, const struct track_rest_look *look);

/* How far a look is from the newest one: along the array, over ground, and with half
 * of what the array's own way does not account for in range, for of a walker or a cyclist
 * one part and then another is heard, one behind the other.  0: there is none. */
double track_rest_step_m(const struct track_rest *r, const struct track_rest_look *look);

/* share: how much of a look this is, as far as it tells anything new; keep: of what came
 * before, 0..1. */
void track_rest_add(struct track_rest *r, const struct track_rest_look *look,
                    double share, double keep);

/* Sum of the squares that are left, in units of their variances, over what a scatterer at
 * rest would leave in one of ten million cases; above 1 it has moved by itself. */
double track_rest_misfit(const struct track_rest *r);

/* How far a look is from where the scatterer would be heard at rest: squares in units of
 * their variances, of two degrees of freedom. */
double track_rest_distance2(const struct track_rest *r,
                            const struct track_rest_look *look);

#endif
