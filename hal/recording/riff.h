/* SPDX-License-Identifier: MIT */
/* hal/recording/riff.h -- how much sound a WAV file promises, and how much of it is
 * there. libsndfile reads what is left of a truncated file without a word. */
#ifndef ANLOS_HAL_RECORDING_RIFF_H
#define ANLOS_HAL_RECORDING_RIFF_H

#include <sndfile.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

/* Sizes of the data chunk in bytes.  A writer that never closed its file leaves 0 or
 * 0xffffffff: then both are what is there.  0, -EINVAL (no RIFF, RIFX or RF64 file, or no
 * data chunk), -ESPIPE (not a regular file), a negative errno of reading. */
int riff_data_size(const char *path, uint64_t *promised, uint64_t *present);

enum { RIFF_PCM = 1, RIFF_FLOAT = 3, RIFF_EXTENSIBLE = 0xfffe };

/* WAV files alone: libsndfile reads some thirty formats, and whatever a file is called;
 * readers of compressed ones are where its faults are. */

/* A regular file, RIFF, RIFX or RF64, of PCM or float samples; sf_close it.  0, -EINVAL
 * (anything else; the error names it), -ENOENT and other errno of reading. */
int wav_open(SNDFILE **out, SF_INFO *info, const char *path, struct error *why);

/* What it says of an error of hal/recording/riff.h.  err. */
int wav_error_say(struct error *why, int err, const char *path);

/* Frames of a WAV file to channels, and what is wrong with them. */

struct wav_samples {
    size_t n_channels;
    size_t n_frames; /* wanted, of each channel */
    size_t n_slots, slot_samples;
    bool is_float; /* of the file */
};

/* frames [n][n_channels], the file's from `first` on, to samples [n_channels][n_frames].
 */
void wav_samples_separate(const struct wav_samples *w, const float *restrict frames,
                          size_t first, size_t n, float *restrict samples);

/* Zeros in each channel from n on. */
void wav_samples_finish(const struct wav_samples *w, size_t n, float *samples);

/* Counts clipped samples (hal/recording/recording.h) and those that are not finite among
 * the first n of each channel; the latter become 0.  Counts are [n_slots][n_channels]. */
void wav_samples_count(const struct wav_samples *w, float *samples, size_t n,
                       uint32_t *clipped, uint32_t *not_finite);

#endif
