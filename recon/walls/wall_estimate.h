/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_estimate.h -- the walls around an array, from the echoes of its own
 * chirps: the one that most pairs hear, fitted (recon/walls/wall_fit.h); then what it
 * explains is taken away, and the next one is looked for.
 *
 * A wall is believed when most of the pairs hear it where the plane has it.  An edge or a
 * thing does not look like that from everywhere.  What two walls, or a wall and the
 * ground, make together in their corner is taken away with them, and a plane whose sound
 * would have to pass through a nearer wall is an image of something in that one.
 *
 * A wall may bend about the upright, as a pillar does, and a facade by some centimetres.
 * It is told as the plane that touches it, whose turn is the less certain the more it
 * bends; by more than `turn_rad` it is no mirror for this program.
 *
 * A line of elements cannot tell how the wall is turned about the line: the prior must
 * (walls stand upright), and the covariance says how much it is worth.  It cannot tell
 * front from behind either; walls are in front (z > 0). */
#ifndef ANLOS_RECON_WALLS_WALL_ESTIMATE_H
#define ANLOS_RECON_WALLS_WALL_ESTIMATE_H

#include "recon/walls/wall_fit.h"

#define WALL_ESTIMATE_MAX 4

struct wall_estimate_config {
    struct wall_prior prior;
    double reach_m[2];  /* distances that a wall may have from the frame's origin */
    double least_share; /* of the pairs that must hear a wall */
    double rms_m;    /* residuals of a plane that most pairs hear are at most this; of one
                         that half of them hear 0.4 of it */
    double turn_rad; /* one sigma of a turn that counts as known */
    double tilt_rad; /* from upright, of what is a wall and not a floor */
    double aside_rad; /* from straight ahead, of a normal: farther aside a thing near the
                         end of the array looks like a wall */
    bool has_ground;
    struct wall ground; /* known not to be a wall, such as the one that the mount tells */
};

struct wall_estimate {
    struct wall wall; /* its normal points away from the frame's origin */
    double rms_m;     /* of the residuals of paths */
    double share;     /* of the pairs that hear it */
};

struct wall_estimates {
    size_t n;
    struct wall_estimate list[WALL_ESTIMATE_MAX]; /* in the order of being found */
    size_t n_undetermined; /* heard, but these places do not tell how it stands */
    size_t n_bent;         /* heard, and too round to mirror as a plane does, */
    double curvature_1_m;  /* the last of them: > 0 bulges towards the array */
    size_t n_rejected;     /* images in other walls, floors, things */
};

/* Vertical to 2 degrees, sound known to 0.1 %, walls at 0.1 to 5 m that half of the pairs
 * hear within 6 mm. */
void wall_estimate_default(struct wall_estimate_config *cfg);

/* The echoes of a trace follow each other; n_pairs: how many traces were looked at, with
 * echoes or without.  0, -ENOMEM. */
int wall_estimate(struct wall_estimates *out, const struct wall_estimate_config *cfg,
                  const struct wall_echo *echoes, size_t n, size_t n_pairs);

#endif
