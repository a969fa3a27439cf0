/* SPDX-License-Identifier: MIT */
/* recon/walls/near_reflector.h -- a small thing near the array returns every pair's sound
 * too, and some of it where a plane would: by way of one point (s to p to m) and not of
 * an image source.  Whichever explains more of the echoes is there. */
#ifndef ANLOS_RECON_WALLS_NEAR_REFLECTOR_H
#define ANLOS_RECON_WALLS_NEAR_REFLECTOR_H

#include "recon/walls/wall_echo.h"

struct near_reflector {
    double at_m[3];
    double rms_m;   /* of the residuals of paths */
    size_t n_heard; /* pairs that hear it */
};

/* Improves t->at_m, a first guess: reweighted least squares over the echo of each pair
 * that comes nearest, within tolerance_m[0] at first and tolerance_m[1] at last.  What
 * the places of the elements do not tell stays as guessed.  The array's own motion is
 * left out but for what the chirp makes of it.  0, or -EDOM: fewer than 6 pairs. */
int near_reflector_improve(struct near_reflector *t, const struct wall_echo *echoes,
                           size_t n, const double tolerance_m[2]);

#endif
