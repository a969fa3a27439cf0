/* SPDX-License-Identifier: MIT */
/* dsp/blanker.h -- was a ping drowned by a sound that no speaker made: a door that slams,
 * a horn, a stone on the bumper?  Such a sound fits no chirp: compressed, it is spread
 * over all delays at once, between the echoes too, and it begins from one ping to the
 * next.  (The noise blanker of a radio receiver, at the place where echoes are narrow.)
 *
 * The level of what lies between the echoes is an ordered statistic of the powers of each
 * trace, as in dsp/noise_floor.h: their median where a background was subtracted, their
 * lowest tenth where echoes are left.  A ping is blanked when that is BLANKER_RISE over
 * the reference in three of four channels.  The reference is the loudest level so far,
 * which fades within BLANKER_FADES pings, so what becomes louder more slowly, wind, rain
 * or what comes nearer, is none of this.  Of n independent samples in a channel the
 * median is off by 1 / (sqrt(n) ln 2) of itself, 9 % of 260: in noise alone not one ping
 * is blanked.  What is 47 dB below the loudest echo of its trace does no harm.
 *
 * The ping after the last loud one is blanked too, for it may hold the end of the sound
 * where few delays show it, as the one before the first may hold its beginning.  A sound
 * that lasts longer than longest_ns is the noise of the place from then on. */
#ifndef ANLOS_DSP_BLANKER_H
#define ANLOS_DSP_BLANKER_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BLANKER_RISE  4.0 /* 6 dB */
#define BLANKER_FADES 16.0

struct blanker_config {
    size_t n_channels;
    size_t n_samples;   /* of a trace, from one to the next */
    size_t from, until; /* samples that count, until > from */
    int64_t longest_ns;
};

struct blanker;

/* 0, -EINVAL, -ENOMEM. */
int blanker_create(struct blanker **out, const struct blanker_config *cfg);

/* traces [n_channels][n_samples] of a ping, as they were heard; background: the same, or
 * NULL, is subtracted before they are judged.  masked [n_channels]: not looked at.
 * stamp_ns: no older than the one before.  true: blank it. */
bool blanker_execute(struct blanker *b, const float complex *traces,
                     const float complex *background, const bool *masked,
                     int64_t stamp_ns);
void blanker_destroy(struct blanker *b);

#endif
