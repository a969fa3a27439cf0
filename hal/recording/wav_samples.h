/* hal/recording/wav_samples.h -- frames of a WAV file to channels, and what is wrong with
 * them. */
#ifndef ANLOS_HAL_RECORDING_WAV_SAMPLES_H
#define ANLOS_HAL_RECORDING_WAV_SAMPLES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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
