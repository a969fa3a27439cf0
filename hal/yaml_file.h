/* SPDX-License-Identifier: MIT */
/* hal/yaml_file.h -- a YAML file by a libcyaml schema.  Every error reads "file:line:
 * key: what was expected": keys that the schema does not know, keys that are missing or
 * there twice, values of the wrong type or number.  Floats must be finite.
 *
 * The schema is the root mapping: CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct x, ...).
 * A mapping of optional keys only is allocated and zeroed even when all are absent. */
#ifndef ANLOS_HAL_YAML_FILE_H
#define ANLOS_HAL_YAML_FILE_H

#include <stddef.h>

#include <cyaml/cyaml.h>

#include "dsp/error.h"

#define YAML_FILE_MAX_SIZE (4u << 20) /* bytes; a survey is some 10 kB */

/* *out: what the schema describes; yaml_unload it.  0, -ENOENT, -EACCES, other errno of
 * reading, -EINVAL (contents, or too large), -ENOMEM. */
int yaml_load(const char *path, const struct cyaml_schema_value *schema, void **out,
              struct error *why);

/* The same of a text in memory, data[size]; path: what errors call it. */
int yaml_parse(const char *path, const void *data, size_t size,
               const struct cyaml_schema_value *schema, void **out, struct error *why);

/* Frees what yaml_load made; data may be NULL. */
void yaml_unload(const struct cyaml_schema_value *schema, void *data);

/* The path of `name` as seen from the file `path`: joined with its folder unless it is
 * absolute.  free() the result; NULL: no memory. */
char *yaml_sibling(const char *path, const char *name);

/* Where in a file a key stands, for errors about values that a schema cannot judge
 * (ranges, consistency). */

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
