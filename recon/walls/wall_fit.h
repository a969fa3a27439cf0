/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_fit.h -- one wall among echoes of which many are not its: a first
 * guess, and least squares to the echoes that it explains, with covariance: a plane, or
 * what bends about the upright where the echoes tell.
 *
 * The guess: for each direction of the normal each echo says one distance, and the
 * distance on which most agree, the louder the more, wins (a Hough transform: Duda and
 * Hart, CACM 15 (1972) 11).  No dice: equal echoes give equal walls. */
#ifndef ANLOS_RECON_WALLS_WALL_FIT_H
#define ANLOS_RECON_WALLS_WALL_FIT_H

#include "recon/walls/wall_echo.h"

struct wall_search {
    bool upright;      /* normals without y alone */
    double reach_m[2]; /* least and most distance from the frame's origin */
    double aperture_m; /* how far elements are apart: says how fine directions must be */
    double tilt_rad;   /* with upright false: normals up to this from the level */
};

/* Writes the wall that most agree on, without covariance, and how many pairs do.  The
 * normal has z > 0: an array looks forward.  0 pairs: there is none.  0, -ENOMEM. */
int wall_search_best(const struct wall_search *s, const struct wall_echo *echoes,
                     size_t n, struct wall *out, size_t *n_pairs);

struct wall_prior {
    bool vertical;       /* the normal has no y, give or take */
    double vertical_rad; /* this much, one sigma */
    double sound_speed;  /* relative error of the speed of sound, one sigma */
    double delay_m;      /* of a path that all share: time zero, one sigma */
};

struct wall_fit {
    struct wall wall;     /* with covariance; where it bends, the plane that touches it at
                             the foot of the perpendicular from the middle of the array */
    double curvature_1_m; /* > 0: bulges towards the array; 0: none is told */
    double rms_m;         /* of the residuals of paths */
    size_t n_heard;       /* pairs that hear it */
};

/* Improves *fit, whose plane is a first guess: iteratively reweighted least squares
 * (Tukey's biweight: Holland and Welsch 1977) over the echo of each pair that comes
 * nearest to the wall's path, within tolerance_m[0] at first and tolerance_m[1] at last.
 *
 * It bends if that is told by three sigmas, the pairs hear it so no less, and its radius
 * is over half a metre and, inwards, over its distance.  The covariance is that of the
 * residuals, parts of which are shared by the echoes of an element or a place, and of the
 * prior.  chosen [n]: which echoes counted (not after an error); may be NULL.
 *
 * 0, -EDOM (too few echoes, or they do not determine all three numbers), -ENOMEM. */
int wall_fit_improve(struct wall_fit *fit, const struct wall_prior *prior,
                     const struct wall_echo *echoes, size_t n,
                     const double tolerance_m[2], bool *chosen);

#endif
