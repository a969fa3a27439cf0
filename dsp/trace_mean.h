/* SPDX-License-Identifier: MIT */
/* dsp/trace_mean.h -- the mean of what each speaker's pings have sounded like, channel by
 * channel: of all of them, or of the newest with older ones fading away (exponential
 * average). */
#ifndef ANLOS_DSP_TRACE_MEAN_H
#define ANLOS_DSP_TRACE_MEAN_H

#include <complex.h>
#include <stddef.h>
#include <stdint.h>

struct trace_mean;

/* A ping's traces are [n_channels][n_samples].  0, -EINVAL, -ENOMEM. */
int trace_mean_create(struct trace_mean **out, size_t n_pings, size_t n_channels,
                      size_t n_samples);

/* A channel of a ping: its sound counts into the mean by `share`, or as one of all so
 * far where that is more (0: as one of all), and x[n_samples] -= the mean before that,
 * which is 0 before the first.  Something that moves is in a mean of n, where it was, by
 * 1/n: a mean of fewer than `few` is only subtracted sample by sample where that leaves
 * less than there was, which takes these ghosts away but for where something louder
 * stands.  Returns how many it was of. */
uint32_t trace_mean_take(struct trace_mean *m, size_t ping, size_t channel, double share,
                         uint32_t few, float complex *x);

/* x -= the mean as trace_mean_take does, and nothing is counted into it. */
uint32_t trace_mean_subtract(const struct trace_mean *m, size_t ping, size_t channel,
                             uint32_t few, float complex *x);

/* [n_channels][n_samples] of a ping; 0 where nothing was taken. */
const float complex *trace_mean_of(const struct trace_mean *m, size_t ping);

/* As if nothing had been taken. */
void trace_mean_reset(struct trace_mean *m);
void trace_mean_destroy(struct trace_mean *m);

#endif
