/* SPDX-License-Identifier: MIT */
/* recon/coherent/statics.h -- static corrections (Sheriff and Geldart, Exploration
 * Seismology, 1995, 8.8.2): a column whose elements stand a little beside a straight,
 * even line is imaged as that line, with each trace shifted by what its path is longer.
 *
 * That is exact for echoes from one place, the target.  An echo from an angle beside it
 * keeps the sine of the angle times the displacement of path: for 1 cm rms and 15 degrees
 * 0.7 radians at 11 kHz, most of it across the line, whose positions are corrected in
 * groups. */
#ifndef ANLOS_RECON_COHERENT_STATICS_H
#define ANLOS_RECON_COHERENT_STATICS_H

#include <stddef.h>

#include "recon/geometry.h"

#define STATICS_MOST_M 0.03 /* from the line, each axis: farther is no column */

struct statics {
    struct geometry line; /* the array as it is imaged; owned */
    size_t n_groups;      /* of neighbouring positions */
    double *shift_s;      /* [n_groups][n_speakers][n_microphones] */
};

/* 0, -ENOTSUP (*why: what the geometry lacks), -ENOMEM. */
int statics_create(struct statics **out, const struct geometry *g,
                   const double target_m[3], const char **why);

/* Where the shifts of a position's pairs begin. */
size_t statics_group(const struct statics *s, size_t position);
void statics_destroy(struct statics *s); /* of NULL: nothing */

#endif
