/* SPDX-License-Identifier: MIT */
/* recon/walls/walls.h -- the walls that mirror sound and what the array sees directly, as
 * the topic "wall" or a survey has them. */
#ifndef ANLOS_RECON_WALLS_WALLS_H
#define ANLOS_RECON_WALLS_WALLS_H

#include "dsp/error.h"
#include "recon/ego.h"
#include "recon/survey.h"
#include "recon/walls/wall.h"

#define WALLS_MAX         SURVEY_MAX_WALLS
#define WALLS_MAX_CORNERS 32
#define WALLS_FAR_M       1000.0 /* the far end of a gate that has none */

enum wall_origin {
    WALL_CONFIGURED, /* a survey's, exact */
    WALL_GIVEN,      /* by the vehicle */
    WALL_ESTIMATED,  /* from echoes */
};

struct walls {
    size_t n;
    struct wall_gate list[WALLS_MAX]; /* in the array frame */
    double existence[WALLS_MAX];      /* 0..1 */
    double unseen_s[WALLS_MAX];       /* since it was last seen or given */
    enum wall_origin origin[WALLS_MAX];
    size_t n_corners;                         /* of what is in free view; 0: nothing is */
    double free_view_m[WALLS_MAX_CORNERS][2]; /* x, z, around it */
};

/* The walls that a survey was given, known exactly. */
void walls_from_survey(struct walls *out, const struct survey *s);

/* What is no wall: numbers that are none, a normal whose length is not 1, a covariance
 * that is none, more than there is room for.  0, or -EINVAL with an error. */
int walls_check(const struct walls *w, struct error *why);

/* Normals that are of length 1 but for the digits that somebody wrote; what is exact
 * stays as it is. */
void walls_normalise(struct walls *w);

/* Walls in the vehicle frame as they are in the array's, their normals away from it. */
void walls_to_array(struct walls *w, const struct survey *s);

/* Carries the walls along from the vehicle's earlier frame to the later one; exactly.
 * What is in free view is what the array sees, so it comes along by itself. */
void walls_step(struct walls *w, const struct survey *s, const struct ego_step *step);

/* Does the array look directly at where p stands?  Its height does not matter. */
bool walls_in_free_view(const struct walls *w, const double p[3]);

#endif
