/* dsp/background.h -- coherent background subtraction: compressed traces of the room
 * without the hidden objects are kept, and subtracted with their phase.
 *
 * Compression is linear, so this equals subtraction of the raw samples.  The dsp node
 * keeps traces, because background pings come long before those of the scene and both
 * must be compressed when they come, so that nothing is left to do after the last one.
 * `anlos recon` has both recordings at hand and subtracts samples
 * (nodes/anlos/recon_job), which halves the compressions and stores nothing. */
#ifndef ANLOS_DSP_BACKGROUND_H
#define ANLOS_DSP_BACKGROUND_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

struct background;

/* n_pings: positions x speakers; a ping's traces are [n_channels][n_samples].
 * 0, -EINVAL, -ENOMEM. */
int background_create(struct background **out, size_t n_pings, size_t n_channels,
                      size_t n_samples);

/* Keeps a copy; a second store of the same ping replaces the first. */
void background_store(struct background *b, size_t ping, const float complex *traces);
bool background_has(const struct background *b, size_t ping);

/* traces -= stored.  false, and nothing done: there is none for that ping. */
bool background_subtract(const struct background *b, size_t ping, float complex *traces);
void background_destroy(struct background *b);

#endif
