/* hal/yaml/check.h -- compares a parsed YAML document with a libcyaml schema before
 * libcyaml loads it.  libcyaml alone gives the line of the key before, takes "1.5x" for a
 * number, and cuts 2.5 to 2 where a whole number is meant. */
#ifndef ANLOS_HAL_YAML_CHECK_H
#define ANLOS_HAL_YAML_CHECK_H

#include <cyaml/cyaml.h>
#include <yaml.h>

#include "dsp/complaint.h"

/* 0 or -EINVAL; path is named in the complaint. */
int yaml_check(yaml_document_t *document, const struct cyaml_schema_value *schema,
               const char *path, struct complaint *why);

#endif
