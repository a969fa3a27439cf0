/* SPDX-License-Identifier: MIT */
/* dsp/microphone.h -- a microphone's factory calibration curve;
 * hal/survey/response_file.h reads the files. */
#ifndef ANLOS_DSP_MICROPHONE_H
#define ANLOS_DSP_MICROPHONE_H

#include <stddef.h>

struct microphone {             /* borrows its curve */
    size_t n_points;            /* 0: flat */
    const double *frequency_hz; /* [n_points], rising */
    const double *gain_db;      /* [n_points] */
};

/* Amplitude at a frequency: linear in dB between points, constant outside. */
double microphone_gain(const struct microphone *m, double frequency_hz);

/* What undoes it: 1 / gain, at most 20 dB either way; 1 for no microphone (NULL). */
double microphone_correction(const struct microphone *m, double frequency_hz);

#endif
