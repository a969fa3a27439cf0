/* SPDX-License-Identifier: MIT */
/* hal/alsa/emission.h -- what a speaker is to emit: the survey's chirp, of amplitude 1,
 * or the same from its stop to its start. */
#ifndef ANLOS_HAL_ALSA_EMISSION_H
#define ANLOS_HAL_ALSA_EMISSION_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/survey.h"

/* free() the result, [*n]; NULL: no memory.  Each sample is right to a float's rounding,
 * however long the chirp. */
float *emission_create(const struct survey *s, bool down, size_t *n);

#endif
