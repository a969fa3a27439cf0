/* SPDX-License-Identifier: MIT */
/* recon/frontend/mean_background.h -- backgrounds of a static array: the mean of what
 * was recorded without the hidden objects, or the running mean of all that is heard. */
#ifndef ANLOS_RECON_FRONTEND_MEAN_BACKGROUND_H
#define ANLOS_RECON_FRONTEND_MEAN_BACKGROUND_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "recon/ping.h"

struct mean_background;

/* time_constant_s: of the running mean.  0, -EINVAL, -ENOMEM. */
int mean_background_create(struct mean_background **out, size_t n_speakers,
                           size_t n_microphones, size_t n_samples,
                           double time_constant_s);

/* A ping of the background and its traces[n_microphones][n_samples], which are used up.
 * The mean of its speaker's so far in this pass, to be kept elsewhere. */
const float complex *mean_background_record(struct mean_background *b,
                                            const struct ping *ping,
                                            float complex *traces);

/* What a speaker has sounded like, [n_microphones][n_samples]; NULL: not known. */
const float complex *mean_background_of(const struct mean_background *b, size_t speaker);

/* Subtracts the running mean from a speaker's traces, from the second ping on, where that
 * leaves less than there was (dsp/trace_mean.h): a loud thing that passes by is in it for
 * as long as the mean remembers.  They count into it when the next ones come.  A
 * microphone that is masked stays out of it, and one that was until now keeps its trace
 * as it is.  false: all do. */
bool mean_background_subtract(struct mean_background *b, size_t speaker,
                              int64_t capture_ns, const bool *masked,
                              float complex *traces);

/* The newest traces that were given do not count, for they may be spoiled. */
void mean_background_drop(struct mean_background *b);

/* Of the newest traces that were given, samples that are foreign (1 of [n_microphones]
 * [n_samples]) do not count: as much is heard there as before. */
void mean_background_excise(struct mean_background *b, const uint8_t *foreign);

/* What was heard does not count any more. */
void mean_background_reset(struct mean_background *b);
void mean_background_destroy(struct mean_background *b);

#endif
