/* SPDX-License-Identifier: MIT */
/* hal/room/elements.h -- the elements of a simulated array as they really are, which its
 * survey does not know (a scene's `errors`): where they stand, with their mirror images,
 * and how loud the microphones are. */
#ifndef ANLOS_HAL_ROOM_ELEMENTS_H
#define ANLOS_HAL_ROOM_ELEMENTS_H

#include <stddef.h>
#include <stdint.h>

#include "recon/survey.h"

struct pose {
    const struct survey *survey; /* not owned */
    /* Really, at stage position 0: the survey, which may be calibrated later, knows less.
     */
    double (*speakers_at_m)[3], (*microphones_at_m)[3]; /* [n] */
    double (*stage_errors_m)[3];                        /* [n_positions] */
    /* Set by pose_move and pose_go: */
    double (*speakers_m)[3], (*microphones_m)[3];
    double (*speaker_images_m)[3], (*microphone_images_m)[3]; /* behind the wall */
};

/* Draws the errors: element_m, stage_m rms for each axis.  0, -ENOMEM. */
int pose_create(struct pose *out, const struct survey *s, double element_m,
                double stage_m, uint32_t seed);
void pose_move(struct pose *p, size_t position);

/* Anywhere along the stage: between two positions its error is between theirs. */
void pose_go(struct pose *p, double stage_m);
void pose_clear(struct pose *p);

/* The microphones' curves, which the processor knows, and what they really do. */

/* Gives each of s's microphones a smooth curve of rms ripple_db, serials "sim00"...
 * 0, -ENOMEM. */
int microphones_invent(struct survey *s, double ripple_db, uint32_t seed);

/* out[n_microphones][n_bins], bin k at k * bin_hz: level times the curve (flat without
 * one) times a gain error of rms gain_db that the survey does not know. */
void microphones_respond(const struct survey *s, double level, double gain_db,
                         uint32_t seed, size_t n_bins, double bin_hz, float *out);

#endif
