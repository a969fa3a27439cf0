/* SPDX-License-Identifier: MIT */
/* hal/recording/replica_file.h -- what was emitted, as a mono WAV, where it is no plain
 * chirp. */
#ifndef ANLOS_HAL_RECORDING_REPLICA_FILE_H
#define ANLOS_HAL_RECORDING_REPLICA_FILE_H

#include <stddef.h>

#include "dsp/error.h"

#define REPLICA_MAX_SAMPLES ((size_t)1 << 20)

/* The file's only channel, at sample_rate_hz, without the zeros at its end; free(*out).
 * 0, -EINVAL, -ENOENT and other errno of reading, -ENOMEM. */
int replica_load(float **out, size_t *n, const char *path, double sample_rate_hz,
                 struct error *why);

/* Writes x[n] as float32 to PATH-replica.wav.  0, -EIO, -ENOMEM. */
int replica_save(const float *x, size_t n, const char *path, double sample_rate_hz);

/* Between which frequencies the power density is at most 10 dB below its median where
 * there is sound, for echoes are whitened over that band (dsp/pulse_compress.h): Welch's
 * mean of overlapping windowed pieces, IEEE Trans. Audio 15 (1967) 70.  0, -EINVAL
 * (silent, or one tone). */
int replica_band(const float *x, size_t n, double sample_rate_hz, double band_hz[2]);

#endif
