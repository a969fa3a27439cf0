/* SPDX-License-Identifier: MIT */
/* hal/room/propagate.h -- the sound on its way: what the microphones hear of one chirp,
 * by the arrivals of all pieces.
 *
 * Each arrival is placed between samples by a Kaiser-windowed sinc on a grid of twice the
 * rate (error under -70 dB up to 20 kHz at 48 kHz).  Amplitudes for a source of 1 at 1 m,
 * with r the way in and s the way out:
 *   point     a / (r s)                                  a: scattering length
 *   facet     (jk / 2 pi) dA (cos_in + cos_out)/2 / (r s)    Kirchhoff, rigid
 *   direct    1 / r                                                         */
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
    const float *responses; /* [n_microphones][n_samples / 2 + 1], bin k: k/n_samples of
                               the rate; the amplitude that a microphone makes of 1 */
};

struct propagate;

/* The number of samples to compute, a good one for the FFT, at least `least`. */
size_t propagate_length(size_t least);

/* Plans and allocates, copies emissions and responses.  0, -EINVAL, -ENOMEM. */
int propagate_create(struct propagate **out, const struct propagate_config *cfg);

/* Where everything is at one stage position. */
struct propagate_scene {
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
