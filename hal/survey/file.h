/* SPDX-License-Identifier: MIT */
/* hal/survey/file.h -- survey.yaml: the geometry and timing of a recording. */
#ifndef ANLOS_HAL_SURVEY_FILE_H
#define ANLOS_HAL_SURVEY_FILE_H

#include "dsp/error.h"
#include "recon/survey.h"

/* The keys of hal/survey/yaml.h, and two that stand in place of others:
 *   pings: FILE.csv    the places of speaker and microphone, ping by ping
 *                      (hal/recording/pings_file.h), in place of speakers_m,
 * microphones_m, stage replica: FILE.wav  what was emitted
 * (hal/recording/replica_file.h), in place of chirp Reads and checks; calibration curves
 * are read from their folder (relative to the survey file, as those two are).  Clear with
 * survey_clear.  The error is "file:line: key: what was expected". 0, -ENOENT,
 * -EACCES, -EINVAL, -ENOMEM. */
int survey_load(struct survey *out, const char *path, struct error *why);

/* Only what it says of the place: gate_m, volume, wall and mount, all else 0.  The other
 * keys may be missing. */
int survey_load_place(struct survey *out, const char *path, struct error *why);

/* Writes a file that survey_load reads back to the same survey.  calibration_folder:
 * where the microphones' curves go, relative to the survey file; it is made when missing
 * and curves that are there already stay.  Pings and replica go into PATH-pings.csv and
 * PATH-replica.wav.  NULL: responses are left out.  0, -EEXIST
 * (another curve of that serial is there), other negative errno, and no file. */
int survey_save(const struct survey *s, const char *path, const char *calibration_folder,
                struct error *why);

#endif
