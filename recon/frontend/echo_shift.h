/* SPDX-License-Identifier: MIT */
/* recon/frontend/echo_shift.h -- how much longer has the way over the wall become for one
 * element, since the wall was heard first?
 *
 * What a wall's own errors, the vehicle's motion, time zero and the speed of sound do to
 * an echo they do to all pairs alike: for one speaker it is an offset and a slope along
 * the microphones, and the other way round.  So a pair's path is told against what the
 * other pairs with the same other end say (least squares with Huber's weights), which
 * also takes out where that other end went.  What is left of an element's pairs is its
 * own.
 *
 * A wall with another id is learnt anew, one that was not heard for a while is not; a
 * round is one of all speakers one after the other, and counted by the caller.  Only
 * create allocates. */
#ifndef ANLOS_RECON_FRONTEND_ECHO_SHIFT_H
#define ANLOS_RECON_FRONTEND_ECHO_SHIFT_H

#include <stddef.h>
#include <stdint.h>

#include "recon/survey.h"
#include "recon/walls/wall.h"

#define ECHO_SHIFT_RING  5 /* arrivals that a path is the median of */
#define ECHO_SHIFT_FIRST 8 /* and its reference */

struct echo_path {
    double from_m[3]; /* the other end's mirror image */
    double grown_m;
};

struct echo_shift;

/* Copies what it needs.  0, -ENOMEM. */
int echo_shift_create(struct echo_shift **out, const struct survey *s);

/* The wall whose echoes come from now on, in the array frame; NULL: none is known. */
void echo_shift_wall(struct echo_shift *e, const struct wall_gate *wall);

/* A ping: delays of the wall's echo, [n_microphones], NaN: not heard well. */
void echo_shift_take(struct echo_shift *e, uint64_t round, size_t speaker,
                     const double *delay_s);

/* The paths of an element, counted with the speakers first, by which it is heard in this
 * round and was before `since`: how many of out [the larger number of speakers or
 * microphones].  sigma_m: of a grown_m, as the other pairs scatter. */
size_t echo_shift_paths(struct echo_shift *e, size_t element, uint64_t round,
                        uint64_t since, struct echo_path *out, double *sigma_m);
/* The same for an element that never stood where the survey has it: against the wall as
 * it is told, whoever was heard before. */
size_t echo_shift_surveyed(struct echo_shift *e, size_t element, uint64_t round,
                           struct echo_path *out, double *sigma_m);
/* It is heard from another place than where it was surveyed: its paths are learnt anew.
 */
void echo_shift_forget(struct echo_shift *e, size_t element);
/* See displacement_stand. */
void echo_shift_stand(struct echo_shift *e, const struct survey *s);
void echo_shift_destroy(struct echo_shift *e);

#endif
