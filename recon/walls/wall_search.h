/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_search.h -- first guesses of a wall among echoes of which many are not
 * its: for each direction of the normal each echo says one distance, and the distance on
 * which most agree, the louder the more, wins (a Hough transform: Duda and Hart, CACM 15
 * (1972) 11).  No dice: equal echoes give equal walls. */
#ifndef ANLOS_RECON_WALLS_WALL_SEARCH_H
#define ANLOS_RECON_WALLS_WALL_SEARCH_H

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

#endif
