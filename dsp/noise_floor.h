/* SPDX-License-Identifier: MIT */
/* dsp/noise_floor.h -- how loud is what is new in each ping: the power of a sample of
 * compressed noise, channel by channel, of the difference between a ping and the one
 * before by the same speaker.  Direct sound, walls and clutter are in both and drop out;
 * the noise of two pings is twice that of one.  While the array moves clutter is new in
 * each ping, too; then what is quietest in the ping itself tells, between the echoes.  Of
 * the two that is taken which is less over all channels.
 *
 * The power of complex noise is exponential: its part q is below -ln(1 - q) of its mean.
 * Of the difference that is the median, for what moves is louder in a few samples only;
 * of the ping the lowest tenth.
 *
 * A ping costs about 60 passes over its samples (dsp/rank.h). */
#ifndef ANLOS_DSP_NOISE_FLOOR_H
#define ANLOS_DSP_NOISE_FLOOR_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

struct noise_floor_config {
    size_t n_speakers, n_channels;
    size_t n_samples;   /* of a trace, from one to the next */
    size_t from, until; /* samples that count, until > from */
};

struct noise_floor;

/* Keeps a ping of each speaker.  0, -EINVAL, -ENOMEM. */
int noise_floor_create(struct noise_floor **out, const struct noise_floor_config *cfg);

/* traces [n_channels][n_samples].  unfit[n_channels]: samples that are none, of which the
 * power is NaN and the next ping not the worse; NULL: all fit.  power [n_channels], NaN,
 * too, at the first ping of a speaker that fits; left alone (false) where all would be.
 */
bool noise_floor_execute(struct noise_floor *f, size_t speaker,
                         const float complex *traces, const bool *unfit, double *power);
void noise_floor_destroy(struct noise_floor *f);

#endif
