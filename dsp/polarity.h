/* dsp/polarity.h -- which speakers and microphones are inverted, from the phase of what
 * each microphone heard of each speaker.
 *
 * A pair's phase is the speaker's plus the microphone's: the matrix of unit phasors has
 * rank one, and its leading singular vectors (power iteration) are the channels' phases
 * up to one common turn.  A channel is inverted when its phase is on the other side from
 * most of its kind.  So a delay that all have, or speakers that turn the phase by any
 * amount in common, do not matter, and inverting all speakers cannot be told from
 * inverting none. */
#ifndef ANLOS_DSP_POLARITY_H
#define ANLOS_DSP_POLARITY_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/* peaks [n_speakers][n_microphones]: of the analytic signal, 0 where nothing was heard.
 * A channel that no peak tells of is not inverted.  0, -ENOMEM. */
int polarity_find(size_t n_speakers, size_t n_microphones, const double complex *peaks,
                  bool *speaker_inverted, bool *microphone_inverted);

#endif
