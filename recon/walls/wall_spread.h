/* SPDX-License-Identifier: MIT */
/* recon/walls/wall_spread.h -- how much the echoes of a wall scatter, and what of it they
 * share: residuals taken apart into what is of each pair, of each speaker, each
 * microphone and each place of the array (that are not where they should be: variance
 * components, Searle, Casella and McCulloch 1992), and of what is shared by all. */
#ifndef ANLOS_RECON_WALLS_WALL_SPREAD_H
#define ANLOS_RECON_WALLS_WALL_SPREAD_H

#include "recon/walls/wall_echo.h"

#define WALL_LEAST_SIGMA_M 2e-4 /* residuals are not believed to be smaller */

struct wall_prior {
    bool vertical;       /* the normal has no y, give or take */
    double vertical_rad; /* this much, one sigma */
    double sound_speed;  /* relative error of the speed of sound, one sigma */
    double delay_m;      /* of a path that all share: time zero, one sigma */
};

enum { WALL_FLAT = 3, WALL_BENT }; /* how many numbers say how a wall stands */

struct wall_row { /* one pair's echo that counts */
    size_t echo;
    double residual_m;
    double slope[WALL_BENT]; /* of its path, by the wall's two turns, its distance and how
                                it bends */
};

struct wall_rows {
    const struct wall_echo *echoes;
    size_t n;
    struct wall_row *list; /* [n] */
};

/* J' V J, [unknowns][unknowns]: J the slopes, V the covariance of the paths.  0,
 * -ENOMEM. */
int wall_spread(const struct wall_rows *f, const struct wall_prior *prior,
                size_t unknowns, double *out);

#endif
