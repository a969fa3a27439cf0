/* SPDX-License-Identifier: MIT */
/* hal/room/microphones.h -- the microphones of a simulated array: the curves that the
 * processor knows, and what they really do. */
#ifndef ANLOS_HAL_ROOM_MICROPHONES_H
#define ANLOS_HAL_ROOM_MICROPHONES_H

#include <stddef.h>
#include <stdint.h>

#include "recon/survey.h"

/* Gives each of s's microphones a smooth curve of rms ripple_db, serials "sim00"...
 * 0, -ENOMEM. */
int microphones_invent(struct survey *s, double ripple_db, uint32_t seed);

/* out[n_microphones][n_bins], bin k at k * bin_hz: level times the curve (flat without
 * one) times a gain error of rms gain_db that the survey does not know. */
void microphones_respond(const struct survey *s, double level, double gain_db,
                         uint32_t seed, size_t n_bins, double bin_hz, float *out);

#endif
