/* SPDX-License-Identifier: MIT */
/* recon/frontend/own_sound.h -- what the array hears of itself: the direct sound of its
 * speakers, how they ring on, and, behind a slot, the direct sound of the next one.  That
 * stays as it is from round to round, however the vehicle moves, while all else goes by:
 * it is the median of what the newest rounds of a vehicle on the move had, each speaker
 * for itself.  (Of one that stands everything stays, and a background has it.)  A median,
 * not a mean: what passes close to the array is a thousand times as loud as what is
 * looked for, and leaves nothing in it.  Noise gets louder by pi / 2 over the rounds, 0.7
 * dB.
 *
 * Behind the slot the next emission's echoes are heard as well, from a step away: there
 * what is far louder than the echoes before is muted, for as long as it is. */
#ifndef ANLOS_RECON_FRONTEND_OWN_SOUND_H
#define ANLOS_RECON_FRONTEND_OWN_SOUND_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

struct own_sound;

/* Of traces [n_microphones][n_samples], behind the slot from sample `behind` <= n_samples
 * on.  0, -EINVAL, -ENOMEM.  Free with own_sound_destroy. */
int own_sound_create(struct own_sound **out, size_t n_speakers, size_t n_microphones,
                     size_t n_samples, size_t behind);

/* Subtracts what is known of a speaker's, from its fourth ping on the move, and learns
 * from its traces while the vehicle moves.  masked [n_microphones]: these traces are no
 * sound, and stay as they are. */
void own_sound_subtract(struct own_sound *o, size_t speaker, bool moves,
                        const bool *masked, float complex *traces);

/* Of the traces that were newest subtracted from: mutes behind the slot what is too loud,
 * and all where nothing was known.  Where a background was subtracted, too, there is no
 * need for it. */
void own_sound_mute(struct own_sound *o, float complex *traces);
void own_sound_destroy(struct own_sound *o);

#endif
