/* dsp/levels.h -- gains of speakers and microphones from the level of each pair: a pair's
 * level is the speaker's gain plus the microphone's, in dB, least squares over all pairs;
 * twice more with pairs that are off by more than three standard deviations left out. */
#ifndef ANLOS_DSP_LEVELS_H
#define ANLOS_DSP_LEVELS_H

#include <stddef.h>

struct levels {
    double mean_db;     /* of a pair whose channels are average */
    double residual_db; /* rms of the pairs used */
    size_t n_used;
    size_t n_speakers_unknown, n_microphones_unknown; /* in no pair that was used */
};

/* level_db [n_speakers][n_microphones], NaN: not heard.  Gains come relative to the mean
 * of their kind, NaN where they are unknown.  0, -ENODATA (no pair at all), -ENOMEM. */
int levels_fit(struct levels *out, size_t n_speakers, size_t n_microphones,
               const double *level_db, double *speaker_db, double *microphone_db);

#endif
