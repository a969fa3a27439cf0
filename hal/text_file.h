/* SPDX-License-Identifier: MIT */
/* hal/text_file.h -- texts: opening one that is read line by line, and numbers in it that
 * are short and lose nothing. */
#ifndef ANLOS_HAL_TEXT_FILE_H
#define ANLOS_HAL_TEXT_FILE_H

#include <stdio.h>

#include "dsp/error.h"

#define TEXT_FILE_MAX_SIZE (64u << 20) /* bytes */

/* A regular file of at most TEXT_FILE_MAX_SIZE: paths stand in files that anyone may have
 * written, and a device or a pipe has no end.  0, -EINVAL (or too large), -ENOENT and
 * other errno of opening. */
int text_file_open(FILE **out, const char *path, struct error *why);

enum { DECIMAL_SIZE = 32 };

/* Writes the shortest decimal that reads back to the same double: 0.01, not
 * 0.010000000000000000208.  Returns out. */
const char *decimal_print(double x, char out[DECIMAL_SIZE]);

#endif
