/* dsp/microphone.h -- a microphone's factory calibration: dB against Hz, as text. */
#ifndef ANLOS_DSP_MICROPHONE_H
#define ANLOS_DSP_MICROPHONE_H

#include <stddef.h>

struct microphone {
    size_t n_points;
    double *frequency_hz; /* [n_points], rising */
    double *gain_db;      /* [n_points] */
};

/* Parses the file formats of Dayton (a "*1000Hz" head line, then Hz TAB dB) and miniDSP
 * (a quoted head line).  Lines without two numbers at the start are passed over before
 * the first point; after it they are errors, unless blank; so are frequencies that do not
 * rise and gains beyond +-200 dB. 0, a negative errno of opening or reading, -EINVAL with
 * *line set (0: no points at all), -ENOMEM. */
int microphone_load(struct microphone *out, const char *path, size_t *line);

/* Amplitude at a frequency: linear in dB between points, constant outside. */
double microphone_gain(const struct microphone *m, double frequency_hz);
void microphone_clear(struct microphone *m);

#endif
