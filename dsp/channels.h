/* SPDX-License-Identifier: MIT */
/* dsp/channels.h -- what the table of pairs, each speaker as each microphone hears it,
 * tells of the channels: how loud they are, which are inverted, and which are wired to
 * another's place. */
#ifndef ANLOS_DSP_CHANNELS_H
#define ANLOS_DSP_CHANNELS_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

/* Gains from the level of each pair: that is the speaker's gain plus the microphone's,
 * in dB, least squares over all pairs; twice more with pairs that are off by more than
 * three standard deviations left out. */
struct levels {
    double mean_db;     /* of a pair whose channels are average */
    double residual_db; /* rms of the pairs used */
    size_t n_used;
    size_t n_speakers_unknown, n_microphones_unknown; /* in no pair that was used */
};

/* level_db [n_speakers][n_microphones], NaN: not heard.  Gains come relative to the mean
 * of their kind, NaN where they are unknown.  0, -ENODATA (no pair at all), -ENOMEM. */
int levels_fit(struct levels *out, size_t n_speakers, size_t n_microphones,
               const double *level_db, double *speaker_db, double *microphone_db);

/* Which speakers and microphones are inverted, from the phase of what each microphone
 * heard of each speaker.
 *
 * A pair's phase is the speaker's plus the microphone's: the matrix of unit phasors has
 * rank one, and its leading singular vectors (power iteration) are the channels' phases
 * up to one common turn.  A channel is inverted when its phase is on the other side from
 * most of its kind.  So a delay that all have, or speakers that turn the phase by any
 * amount in common, do not matter, and inverting all speakers cannot be told from
 * inverting none. */

/* peaks [n_speakers][n_microphones]: of the analytic signal, 0 where nothing was heard.
 * A channel that no peak tells of is not inverted.  0, -ENOMEM. */
int polarity_find(size_t n_speakers, size_t n_microphones, const double complex *peaks,
                  bool *speaker_inverted, bool *microphone_inverted);

/* Do channels answer from where they should?  A channel whose arrivals fit the place of
 * another one better than its own is wired to that one.
 *
 * Its misfit to a place is the median over the other kind's channels of the difference
 * between when it was heard and when it should have been: single channels of the other
 * kind that are wrong themselves do not matter. */

struct channel_place {
    size_t answers_as;     /* itself, when there is no doubt */
    double own_s, other_s; /* misfit to its own place, and to that of answers_as; NaN: it
                              was not heard often enough */
};

/* heard [n][n_others]: arrivals without the latency, in s, NaN where there is none;
 * expected [n][n_others]: distance over speed.  A channel keeps its place unless its
 * misfit there is over tolerance_s and another place halves it.  out [n].
 * 0, -ENOMEM. */
int channel_order_find(size_t n, size_t n_others, const double *heard,
                       const double *expected, double tolerance_s,
                       struct channel_place *out);

#endif
