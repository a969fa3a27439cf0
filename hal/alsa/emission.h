/* hal/alsa/emission.h -- what a speaker is to emit: the survey's chirp, of amplitude 1.
 */
#ifndef ANLOS_HAL_ALSA_EMISSION_H
#define ANLOS_HAL_ALSA_EMISSION_H

#include <stddef.h>

#include "msgs/survey.h"

/* free() the result, [*n]; NULL: no memory.  Each sample is right to a float's rounding,
 * however long the chirp. */
float *emission_create(const struct survey *s, size_t *n);

#endif
