/* SPDX-License-Identifier: MIT */
/* hal/text_file.h -- texts: one that is read line by line, one that appears whole, and
 * numbers in it that are short and lose nothing. */
#ifndef ANLOS_HAL_TEXT_FILE_H
#define ANLOS_HAL_TEXT_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "dsp/error.h"

#define TEXT_FILE_MAX_SIZE (64u << 20) /* bytes */

/* A regular file of at most TEXT_FILE_MAX_SIZE: paths stand in files that anyone may have
 * written, and a device or a pipe has no end.  0, -EINVAL (or too large), -ENOENT and
 * other errno of opening. */
int text_file_open(FILE **out, const char *path, struct error *why);

/* Hands out each line of such a file, with its end, by its number from 1, until one is
 * refused.  0, what `take` returned, errors of text_file_open, -EIO. */
int text_file_lines(const char *path, int (*take)(void *ctx, char *line, size_t number),
                    void *ctx, struct error *why);

/* Writes what `print` does into PATH.part, and puts that in the place of what is there.
 * synced: on the disk by then, so that a power cut leaves one of them whole.  0, -ENOMEM,
 * errno of writing: what was there stays. */
int text_file_write(const char *path, bool synced,
                    void (*print)(FILE *f, const void *what), const void *what);

enum { DECIMAL_SIZE = 32 };

/* Writes the shortest decimal that reads back to the same double: 0.01, not
 * 0.010000000000000000208.  Returns out. */
const char *decimal_print(double x, char out[DECIMAL_SIZE]);

#endif
