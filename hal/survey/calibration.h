/* SPDX-License-Identifier: MIT */
/* hal/survey/calibration.h -- what `anlos calibrate` has measured of an array, and how a
 * survey and samples are set right by it.  `anlos calibrate` writes a file, which every
 * array reads (`alsa:` by its rig, `sim:` and `wav:` by the option "calibrated=FILE"):
 *
 *   array: "alsa:hw:2,0?rig=lab.yaml"  # it was made with
 *   made: 2026-05-01T12:00:00Z         # last changed
 *   geometry: 6f0c41d2a7b3e589         # stands for the places of the elements
 *   sample_rate_hz: 48000
 *   speakers: 16
 *   microphones: 16
 *   latency_samples: 123.45            # from here on each part may be missing
 *   temperature_c: 21.5
 *   humidity_percent: 45
 *   sound_speed_m_s: 344.49
 *   channels: {inverted_speakers: [], dead_microphones: [3]}    # numbers from 0
 *   gains: {speakers_db: [0.5, -0.5], microphones_db: [1, -1]}  # over their mean
 *   places:                            # in the array frame, in place of the survey's
 *     speakers_m: [[0, 0.001, 0], [0.001, 0.067, -0.002]]
 *     microphones_m: [[0.08, 0, 0.003], [0.081, 0.066, 0]]
 *     sigma_m: 0.0005                  # what is left of their errors
 *   background: empty-room             # a recording's folder, relative to this file
 */
#ifndef ANLOS_HAL_SURVEY_CALIBRATION_H
#define ANLOS_HAL_SURVEY_CALIBRATION_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "recon/survey.h"

enum calibration_fault {
    CALIBRATION_INVERTED = 1,
    CALIBRATION_DEAD = 2,
    CALIBRATION_CLIPPED = 4,
    CALIBRATION_NOISY = 8,
};

struct calibration_channel {
    double gain_db;  /* over the mean of its kind; 0: not measured */
    unsigned faults; /* enum calibration_fault; 0: none, or not looked for */
};

struct calibration {
    char array[512];   /* the URI it was made with */
    char made[32];     /* when it was last changed, "2026-05-01T12:00:00Z" */
    char geometry[24]; /* stands for the places of the elements in the survey */
    double sample_rate_hz;
    double latency_samples;                                  /* NaN: not measured */
    double temperature_c, humidity_percent, sound_speed_m_s; /* NaN: not known */
    bool has_channels, has_gains;                            /* looked at */
    double (*places_m)[3]; /* [n_speakers + n_microphones], speakers first; NULL: those of
                              the survey */
    double places_sigma_m; /* what is left of their errors, rms of all axes */
    size_t n_speakers, n_microphones;
    struct calibration_channel *speakers;    /* [n_speakers] */
    struct calibration_channel *microphones; /* [n_microphones] */
    char *background; /* folder, relative to the calibration file; NULL: none */
};

#define CALIBRATION_MAX_GAIN_DB 20.0

/* One without any measurement, of no array in particular.  0, -ENOMEM. */
int calibration_create(struct calibration **out, size_t n_speakers, size_t n_microphones);

/* It is of this array from now on: its URI, its rate and the places of its elements. */
void calibration_name(struct calibration *c, const struct survey *s, const char *array);

/* Is it for this array: number and places of elements (those it was made with, or those
 * that it found), sample rate?  path: for the error.  0, -EINVAL. */
int calibration_fits(const struct calibration *c, const struct survey *s,
                     const char *path, struct error *why);

/* How far places may be from those of the survey: farther is another array. */
#define CALIBRATION_MAX_MOVE_M 0.1

/* Latency, temperature, speed of sound and places into the survey, where they are known.
 * 0, -EINVAL (does not fit, or the survey is not plausible with it), and *s as it was. */
int calibration_apply(const struct calibration *c, struct survey *s, const char *path,
                      struct error *why);

/* samples [n_microphones][n_samples] of a ping of one speaker; c may be NULL. */
void calibration_correct(const struct calibration *c, size_t speaker, size_t n_samples,
                         float *samples);
void calibration_destroy(struct calibration *c);

/* Every value is within its plausible range, or the error is "file:line: key: ..."
 * with that range.  0, -ENOENT, -EACCES, -EINVAL, -ENOMEM. */
int calibration_load(struct calibration **out, const char *path, struct error *why);

/* Appears whole or not at all, in place of an earlier one.  0, other negative errno. */
int calibration_save(const struct calibration *c, const char *path, struct error *why);

/* For an array that is being opened: calibration_load and _apply.  path NULL or "": none,
 * and *out is NULL. */
int calibration_take(struct calibration **out, const char *path, struct survey *s,
                     struct error *why);

#endif
