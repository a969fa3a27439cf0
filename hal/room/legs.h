/* SPDX-License-Identifier: MIT */
/* hal/room/legs.h -- the ways between each element of the array and each piece. */
#ifndef ANLOS_HAL_ROOM_LEGS_H
#define ANLOS_HAL_ROOM_LEGS_H

#include <stdbool.h>
#include <stddef.h>

#include "hal/room/mirror.h"
#include "hal/room/scatter.h"

struct legs {
    size_t n_pieces, room;
    double *delay; /* [n_elements][n_pieces], in the caller's unit */
    float *gain;   /* 1 / r; 0 of a piece that looks away, or that the wall does
                      not reach */
    float *cosine; /* of incidence; 1 where a piece has no front */
    float *rate;   /* how fast r grows while the elements move */
};

/* Fills in the ways to where sound enters (or, outward, leaves) the pieces; mirror: the
 * elements are images in it, NULL: they are there; velocity: of them all, NULL: the rate
 * is left alone.  Grows its arrays as needed.  0, -ENOMEM. */
int legs_set(struct legs *l, const double (*elements)[3], size_t n_elements,
             const struct scatter *s, bool outward, const struct mirror *mirror,
             const double *velocity, double delay_per_m);
void legs_clear(struct legs *l);

#endif
