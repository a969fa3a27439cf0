/* SPDX-License-Identifier: MIT */
/* hal/room/emitter.h -- what the microphones hear of one chirp while everything moves:
 * the echo of each piece is the emission on a time axis of its own.  Amplitudes as in
 * hal/room/propagate.h, by the ways at the middle of the chirp; moving changes them by
 * v/c, which is left out. */
#ifndef ANLOS_HAL_ROOM_EMITTER_H
#define ANLOS_HAL_ROOM_EMITTER_H

#include <stdbool.h>
#include <stddef.h>

#include "hal/room/glint.h"
#include "hal/room/mirror.h"

/* An emission that can be read at any time and pace: what reaches a microphone from a
 * thing that moves is the emission on a stretched time axis.
 *
 * Between its samples the wave is the band-limited interpolation: four points a sample
 * by FFT, and around each its series of eight terms, from both sides (error of a tone of
 * frequency f at rate fs, at most: (2 pi f / 4 fs)^8 / 8!, -121 dB at 20 kHz and 48 kHz,
 * -109 dB at the band's end).  Terms lie in rows, so that samples in a row are read as
 * vectors, whatever the pace. */

struct wave;

/* samples[n].  derivative: the wave is its derivative by the sample.  0, -EINVAL,
 * -ENOMEM. */
int wave_create(struct wave **out, const float *samples, size_t n, int derivative);
void wave_destroy(struct wave *w);

/* The emission's time at sample t of the recording, all in samples:
 *   u = (t - start) / length,  time = n (u + bend u (1 - u)). */
struct wave_axis {
    double start, length; /* of the stretched emission */
    double bend;
};

/* y[n] += amplitude times the wave on that axis. */
void wave_add(const struct wave *w, const struct wave_axis *axis, float amplitude,
              float *restrict y, size_t n);

struct emitter_config {
    double sample_rate_hz;
    size_t n_samples; /* of what a microphone hears; propagate_length */
    size_t n_speakers, n_microphones;
    const float *emissions[2]; /* [n_speakers][n_chirp], upward and downward; the latter
                                  may be NULL */
    size_t n_chirp;
    const float *responses; /* [n_microphones][n_samples / 2 + 1] as propagate_config's */
    bool facets;            /* are there any? */
};

struct emitter;

/* Plans and tabulates; copies emissions and responses.  0, -EINVAL, -ENOMEM. */
int emitter_create(struct emitter **out, const struct emitter_config *cfg);
void emitter_destroy(struct emitter *e);

/* A point in straight motion: at_m at time 0. */
struct doppler_point {
    double at_m[3], velocity_m_s[3];
};

/* Its image behind the wall { p : normal . p = distance_m }. */
void doppler_mirror(const double normal[3], double distance_m,
                    const struct doppler_point *p, struct doppler_point *out);

struct emitter_piece { /* as scatter_piece, in motion */
    struct doppler_point in, out;
    double normal[3]; /* 0: it looks everywhere */
    double weight;
    bool facet;
    struct glint_part part; /* of a body, whose parts hide each other: in is its centre,
                               and the weight a factor on what it glints */
    size_t body;
};

/* Where everything is when the chirp begins, and how it moves. */
struct emitter_scene {
    double sound_speed_m_s, latency_samples;
    size_t speaker; /* whose emission */
    bool down;
    struct doppler_point source, source_image;
    const struct doppler_point *microphones, *microphone_images; /* [n_microphones] */
    const struct emitter_piece *hidden, *clutter; /* by way of the wall, and without */
    const struct emitter_piece *mirrored; /* clutter that is heard by way of it, too */
    size_t n_hidden, n_clutter, n_mirrored;
    const struct mirror *mirror; /* that wall */
    double mirror_gain, direct_gain, wall_echo_gain;
};

/* heard[n_microphones][n_samples] */
void emitter_execute(struct emitter *e, const struct emitter_scene *scene, float *heard);

#endif
