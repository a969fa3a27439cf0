/* SPDX-License-Identifier: MIT */
/* recon/static_array/first_return.h -- nothing behind a wall is heard before the wall
 * itself is: what comes earlier, and the wall's own echo, is muted.  It would be brighter
 * than all that hides, and hide it. */
#ifndef ANLOS_RECON_STATIC_ARRAY_FIRST_RETURN_H
#define ANLOS_RECON_STATIC_ARRAY_FIRST_RETURN_H

#include <complex.h>
#include <stdbool.h>
#include <stdint.h>

#include "dsp/pulse_compress.h"
#include "recon/walls/walls.h"

/* Behind a wall; sidelobes of its echo, how rough it is, and what a vehicle moves while
 * sound is under way. */
#define FIRST_RETURN_M 0.15

struct first_return { /* {0}: no wall is known */
    struct walls walls;
    bool told; /* by who finds walls, at: */
    int64_t stamp_ns;
};

/* The walls that a survey was given count, where they are, until better is known.
 */
void first_return_survey(struct first_return *f, const struct survey *s);

/* As they stand at an instant; no walls: nothing is muted. */
void first_return_walls(struct first_return *f, const struct walls *walls,
                        int64_t stamp_ns);

/* traces[n_microphones][n_samples] of a ping: of several walls the nearest decides.
 * path: of the vehicle; NULL, or where it does not reach: it stands. */
void first_return_mute(const struct first_return *f, const struct survey *s,
                       const struct ego_path *path, size_t speaker, int64_t stamp_ns,
                       const struct trace_format *format, float complex *traces);

#endif
