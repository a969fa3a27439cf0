/* SPDX-License-Identifier: MIT */
/* hal/survey/response_file.h -- a microphone's factory calibration as text: head lines,
 * then "Hz dB" a line, as Dayton and miniDSP ship it. */
#ifndef ANLOS_HAL_SURVEY_RESPONSE_FILE_H
#define ANLOS_HAL_SURVEY_RESPONSE_FILE_H

#include "dsp/error.h"
#include "recon/survey.h"

/* Reads FOLDER/SERIAL.txt.  Lines without a number at the start are ignored before
 * the first point; after it, and frequencies that do not rise, are errors.  *out owns its
 * arrays: response_clear.  0, a negative errno of opening, -EINVAL, -ENOMEM. */
int response_load(struct survey_response *out, const char *folder, const char *serial,
                  struct error *why);

/* Writes FOLDER/SERIAL.txt, unless a file is there that reads the same.  0, -EEXIST (it
 * reads differently), other negative errno. */
int response_save(const struct survey_response *r, const char *folder, struct error *why);

/* Gain as a factor: linear in dB between points, constant outside them. */
double response_gain(const struct survey_response *r, double frequency_hz);
void response_clear(struct survey_response *r);

#endif
