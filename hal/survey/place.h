/* SPDX-License-Identifier: MIT */
/* hal/survey/place.h -- where in a YAML file a key stands, for errors about values
 * that a schema cannot judge (ranges, consistency). */
#ifndef ANLOS_HAL_SURVEY_PLACE_H
#define ANLOS_HAL_SURVEY_PLACE_H

#include <stddef.h>

#include "dsp/error.h"

/* Line (from 1) of a key such as "chirp.start_hz", "objects[2].size_m", "volume.x_m[1]".
 * When the end of the path is not in the file, the line of its deepest part that is; 0
 * when nothing of it is.  Reads the file again: for errors only. */
size_t yaml_line(const char *path, const char *key);

/* Writes "path:line: key: text" and returns err. */
int yaml_error_say(struct error *why, int err, const char *path, const char *key,
                   const char *format, ...) __attribute__((format(printf, 5, 6)));

/* Is the number there within min to max?  0, or -EINVAL with an error. */
int yaml_check_range(const char *path, const char *key, double value, double min,
                     double max, struct error *why);

/* An error of a check that knows no file, such as "chirp_start_hz 0 is ...", gets
 * "path:line: " in front.  The line is that of the first word that is a key of the file,
 * as it stands or split at an underscore ("chirp_start_hz" is chirp.start_hz). */
void yaml_place_error(struct error *why, const char *path);

#endif
