/* SPDX-License-Identifier: MIT */
/* dsp/eigencanceler.h -- takes out of an array's channels what all of them have at once,
 * with gains that stay: hum in the cables, a tone from one place (the eigenanalysis
 * interference canceler: Haimovich and Bar-Ness, IEEE Trans. Signal Processing 39, 1991).
 * The covariance of what is new in each ping, against the one before by the same speaker,
 * averaged over some pings, has one large eigenvalue for each such source; its
 * eigenvector is projected out of every sample.  An echo of a chirp comes to the channels
 * at different times, is in no one of these directions, and loses one part of n_channels
 * for each.
 *
 * A direction is taken out while it has EIGENCANCELER_SHARE or more of the power that is
 * left, and at most EIGENCANCELER_MOST are. */
#ifndef ANLOS_DSP_EIGENCANCELER_H
#define ANLOS_DSP_EIGENCANCELER_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#define EIGENCANCELER_SHARE 0.5
#define EIGENCANCELER_MOST  3
#define EIGENCANCELER_KEEPS 0.8 /* of the covariance, from ping to ping */

struct eigencanceler;

struct eigencanceler_config {
    size_t n_speakers, n_channels;
    size_t n_samples; /* of a trace, from one to the next */
};

/* Keeps a ping of each speaker.  0, -EINVAL, -ENOMEM. */
int eigencanceler_create(struct eigencanceler **out,
                         const struct eigencanceler_config *cfg);

/* traces [n_channels][n_samples] of the next ping, those of no use all 0.  cancels: what
 * is common to them is taken out; else they stay, and what was common before does not
 * count any more.  How many directions were taken out.  Costs n_channels^2
 * multiplications for each sample. */
size_t eigencanceler_execute(struct eigencanceler *e, size_t speaker, bool cancels,
                             float complex *traces);
void eigencanceler_destroy(struct eigencanceler *e);

#endif
