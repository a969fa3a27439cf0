/* SPDX-License-Identifier: MIT */
/* hal/survey/calibration_file.h -- the calibration file, which `anlos calibrate` writes
 * and every array reads (`alsa:` by its rig, `sim:` and `wav:` by the option
 * "calibrated=FILE"):
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
#ifndef ANLOS_HAL_SURVEY_CALIBRATION_FILE_H
#define ANLOS_HAL_SURVEY_CALIBRATION_FILE_H

#include "hal/survey/calibration.h"

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
