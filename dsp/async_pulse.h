/* SPDX-License-Identifier: MIT */
/* dsp/async_pulse.h -- which samples of a ping another array's chirp made.  Our echoes
 * come at the same delay in successive pings, but for how far their ways may have
 * changed; what another one sends has nothing to do with when we emit, and comes at
 * another.  (The defruiter of a secondary surveillance radar keeps the replies that
 * coincide in successive sweeps in the same way: Stevens, Secondary Surveillance Radar,
 * 1988.)  Where its pulse repetition interval is ours, jitter has to keep the two apart
 * (hal/survey/firing.h).
 *
 * A sample is sure to be foreign when its power is ASYNC_PULSE_RATIO over all that lies
 * within reach of it in one of the two pings before: an echo of ours is in both.  So
 * does an echo that fades by so much all over its surroundings, but not at all
 * microphones at once: a ping is hit where half of them have such samples.  Of a ping
 * that is hit, those are foreign that are ASYNC_PULSE_REST over it.
 *
 * In noise alone, exponential powers, a sample is r times over the loudest of n with
 * probability r! n! / (n + r)!: 10 times over 41 of them once in 10^11, twice once in
 * 900. */
#ifndef ANLOS_DSP_ASYNC_PULSE_H
#define ANLOS_DSP_ASYNC_PULSE_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define ASYNC_PULSE_RATIO 10.0 /* 10 dB */
#define ASYNC_PULSE_REST  2.0
#define ASYNC_PULSE_PINGS 2 /* before this one, that it is held against */

struct async_pulse_config {
    size_t n_channels, n_samples; /* of a trace */
    size_t until;                 /* of them count; 0: all */
    size_t guard;                 /* samples on either side of a foreign one: its pulse */
};

struct async_pulse;

/* 0, -EINVAL, -ENOMEM. */
int async_pulse_create(struct async_pulse **out, const struct async_pulse_config *cfg);

/* The pings before are not comparable with those to come. */
void async_pulse_reset(struct async_pulse *a);

/* traces [n_channels][n_samples], each ping once; masked [n_channels]: not looked at.
 * reach [ASYNC_PULSE_PINGS]: by how many samples an echo may have moved since the ping
 * before, and since the one before that.  foreign [n_channels][n_samples]: 1 or 0, all 0
 * unless the ping is hit.  true: it is. */
bool async_pulse_execute(struct async_pulse *a, const float complex *traces,
                         const bool *masked, const size_t reach[ASYNC_PULSE_PINGS],
                         uint8_t *foreign);
void async_pulse_destroy(struct async_pulse *a);

#endif
