/* SPDX-License-Identifier: MIT */
/* dsp/background.h -- compressed traces of the room without the hidden objects, kept to
 * be subtracted with their phase, and with the air's drift (dsp/drift.h).
 *
 * Compression is linear, so without a drift this equals subtraction of the raw samples.
 * The dsp node keeps traces, because background pings come long before those of the scene
 * and both must be compressed when they come, so that nothing is left to do after the
 * last one.  `anlos recon` has both recordings at hand and, unless the air has
 * changed, subtracts samples (nodes/anlos/recon/reader), which halves the compressions
 * and stores nothing. */
#ifndef ANLOS_DSP_BACKGROUND_H
#define ANLOS_DSP_BACKGROUND_H

#include <complex.h>
#include <stddef.h>

struct background;

/* n_pings: positions x speakers; a ping's traces are [n_channels][n_samples].
 * 0, -EINVAL, -ENOMEM. */
int background_create(struct background **out, size_t n_pings, size_t n_channels,
                      size_t n_samples);

/* Keeps a copy; a second store of the same ping replaces the first. */
void background_store(struct background *b, size_t ping, const float complex *traces);

/* [n_channels][n_samples], until the next store of that ping; NULL: there is none. */
const float complex *background_traces(const struct background *b, size_t ping);
void background_destroy(struct background *b);

#endif
