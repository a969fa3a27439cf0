/* SPDX-License-Identifier: MIT */
/* hal/room/propagate.h -- the sound on its way: what the microphones hear of one chirp,
 * by the arrivals of all pieces.
 *
 * Each arrival is placed between samples by a Kaiser-windowed sinc on a grid of twice the
 * rate (error under -70 dB up to 20 kHz at 48 kHz).  Amplitudes for a source of 1 at 1 m,
 * with r the way in and s the way out:
 *   point     a / (r s)                                  a: scattering length
 *   facet     (jk / 2 pi) dA (cos_in + cos_out)/2 / (r s)    Kirchhoff, rigid
 *   direct    1 / r
 *
 * While the array moves straight on, the delay d of an echo changes with the time t of
 * emission: d(t) = d(m) + r (t - m), m the middle of the chirp, r how fast its ways grow
 * over the speed of sound.  The echo is the emission e on another time axis, as a series
 *   e(u - q (u - m)) = sum over k of (-q)^k (u - m)^k / k! e^(k)(u),   q = r / (1 + r),
 * u = t - d(m): each term is an emission of its own that is heard by the same arrivals,
 * their amplitudes times (-q)^k.  Its rest is as propagate_terms says.  What is left out,
 * that r changes with the angle by v^2 T / (c R) over a chirp, is 60 dB below the echo at
 * 0.1 m/s and 2.5 m. */
#ifndef ANLOS_HAL_ROOM_PROPAGATE_H
#define ANLOS_HAL_ROOM_PROPAGATE_H

#include <stddef.h>

#include "hal/room/mirror.h"
#include "hal/room/scatter.h"

struct propagate_config {
    double sample_rate_hz;
    size_t n_samples; /* of what a microphone hears of one chirp; see propagate_length */
    size_t n_speakers, n_microphones;
    const float *emissions; /* [n_speakers][n_chirp]: of each its chirp */
    size_t n_chirp;
    size_t n_terms;         /* of the series of an array that moves; 0 or 1: it stands */
    const float *responses; /* [n_microphones][n_samples / 2 + 1], bin k: k/n_samples of
                               the rate; the amplitude that a microphone makes of 1 */
};

struct propagate;

/* The number of samples to compute, a good one for the FFT, at least `least`. */
size_t propagate_length(size_t least);

/* How many terms leave a rest under 0.2 % at 20 kHz of 48, of ways along the motion; 1 at
 * speed 0. */
size_t propagate_terms(double speed_m_s, double sound_speed_m_s, size_t n_chirp);

/* Plans and allocates, copies emissions and responses.  0, -EINVAL, -ENOMEM. */
int propagate_create(struct propagate **out, const struct propagate_config *cfg);

/* Where everything is at one stage position, or in the middle of the chirp, and how fast
 * the array and its image move. */
struct propagate_scene {
    double velocity_m_s[3], image_velocity_m_s[3];
    double sound_speed_m_s;
    double latency_samples;
    const double (*speakers_m)[3], (*microphones_m)[3];
    /* Mirrored at the wall: how hidden objects see the array. */
    const double (*speaker_images_m)[3], (*microphone_images_m)[3];
    const struct scatter *points, *facets; /* hidden; NULL or empty: none */
    double mirror_gain;                    /* of both bounces at the wall */
    const struct scatter *clutter;      /* heard without the wall, points; may be NULL */
    const struct scatter *mirrored;     /* clutter that is heard by way of it, too */
    const struct mirror *mirror;        /* that wall */
    double direct_gain, wall_echo_gain; /* 0: none */
};

/* Computes the ways of all pieces.  0, -ENOMEM. */
int propagate_prepare(struct propagate *p, const struct propagate_scene *scene);

/* y[n_samples] = what a microphone hears of a speaker's chirp; after propagate_prepare.
 * Valid until the next call. */
const float *propagate_pair(struct propagate *p, size_t speaker, size_t microphone);
void propagate_destroy(struct propagate *p);

#endif
