/* hal/yaml/depth.h -- how deep a YAML text goes, before anything is made of it: libyaml's
 * time rises with the square of the depth (32 kB of "[" take it seconds). */
#ifndef ANLOS_HAL_YAML_DEPTH_H
#define ANLOS_HAL_YAML_DEPTH_H

#include <stddef.h>

#include "dsp/complaint.h"

#define YAML_MAX_DEPTH 64

/* 0, -EINVAL (deeper; the complaint has the line), -ENOMEM.  Of text that is not YAML it
 * says nothing: 0. */
int yaml_check_depth(const unsigned char *text, size_t size, const char *path,
                     struct complaint *why);

#endif
