/* SPDX-License-Identifier: MIT */
/* hal/room/wave.h -- an emission that can be read at any time and pace: what reaches a
 * microphone from a thing that moves is the emission on a stretched time axis.
 *
 * Between its samples the wave is the band-limited interpolation: four points a sample
 * by FFT, and around each its series of eight terms, from both sides (error of a tone of
 * frequency f at rate fs, at most: (2 pi f / 4 fs)^8 / 8!, -121 dB at 20 kHz and 48 kHz,
 * -109 dB at the band's end).  Terms lie in rows, so that samples in a row are read as
 * vectors, whatever the pace. */
#ifndef ANLOS_HAL_ROOM_WAVE_H
#define ANLOS_HAL_ROOM_WAVE_H

#include <stddef.h>

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

#endif
