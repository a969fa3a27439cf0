/* SPDX-License-Identifier: MIT */
/* hal/yaml/file.h -- a YAML file by a libcyaml schema.  Every error reads "file:line:
 * key: what was expected": keys that the schema does not know, keys that are missing or
 * there twice, values of the wrong type or number.  Floats must be finite.
 *
 * The schema is the root mapping: CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct x, ...).
 * A mapping of optional keys only is allocated and zeroed even when all are absent. */
#ifndef ANLOS_HAL_YAML_FILE_H
#define ANLOS_HAL_YAML_FILE_H

#include <cyaml/cyaml.h>

#include "dsp/error.h"

#define YAML_FILE_MAX_SIZE (4u << 20) /* bytes; a survey is some 10 kB */

/* *out: what the schema describes; yaml_unload it.  0, -ENOENT, -EACCES, other errno of
 * reading, -EFBIG, -EINVAL (contents), -ENOMEM. */
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

#endif
