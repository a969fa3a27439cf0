/* SPDX-License-Identifier: MIT */
/* hal/room/pose.h -- where the elements of a simulated array really are, and their
 * mirror images. */
#ifndef ANLOS_HAL_ROOM_POSE_H
#define ANLOS_HAL_ROOM_POSE_H

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

#endif
