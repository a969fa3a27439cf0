/* nodes/anlos/calibrate/diagnosis.h -- what is the matter with each channel, from each
 * speaker in turn and the direct paths. */
#ifndef ANLOS_NODES_ANLOS_CALIBRATE_DIAGNOSIS_H
#define ANLOS_NODES_ANLOS_CALIBRATE_DIAGNOSIS_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "hal/survey/calibration.h"
#include "nodes/anlos/calibrate/paths.h"

struct diagnosis_channel {
    unsigned faults;      /* enum calibration_fault */
    size_t answers_as;    /* its own number, when it is in its place */
    double level_db;      /* against the median of its kind; -INFINITY: not heard */
    double noise;         /* over the median of its kind; NaN: there is none */
    double noise_rms;     /* of a microphone; 0: takes are equal */
    double overtone;      /* of a speaker, third over first; NaN: not looked at */
    size_t clipped_pings; /* of a microphone: speakers that make it clip */
    uint64_t not_finite;  /* of a microphone: samples that were no number */
};

struct diagnosis {
    size_t n_speakers, n_microphones;
    struct diagnosis_channel *speakers, *microphones;
    struct time_zero time_zero;
    size_t retaken;
    bool has_noise;      /* takes differ */
    bool has_overtones;  /* the chirp has some that can be heard */
    bool either_swapped; /* speakers as named or microphones in like manner: the arrivals
                            are the same */
};

/* 0, -ENODATA (nothing is heard at all), -ENOMEM. */
int diagnosis_make(struct diagnosis *out, struct sounding *s, double speed_m_s,
                   struct error *why);
void diagnosis_clear(struct diagnosis *d);

#endif
