/* SPDX-License-Identifier: MIT */
/* hal/table_file.h -- tables as spreadsheets write them: a line of names, then lines of
 * fields separated by commas, semicolons or tabs (where all separators are one of the
 * latter two, decimals may have commas).  Quotes and space around a field, empty lines,
 * those that begin with # and columns that nobody asked for do not count. */
#ifndef ANLOS_HAL_TABLE_FILE_H
#define ANLOS_HAL_TABLE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

#define TABLE_MAX_FIELDS 64

struct table_column {
    const char *name;
    bool needed;
};

/* A line; fields[n_columns] in the order of the columns, NULL: the file has no such one.
 * Returns NULL, or what is wrong with it. */
typedef const char *table_row(void *ctx, char *const *fields);

/* The error is "file:line: what was expected".  0, -EINVAL, errors of text_file_open,
 * -EIO. */
int table_load(const char *path, const struct table_column *columns, size_t n_columns,
               table_row *row, void *ctx, struct error *why);

/* Cuts a line into fields, of which there are `least` where commas are decimal ones.
 * Returns how many. */
size_t table_split(char *line, size_t least, char *fields[TABLE_MAX_FIELDS]);

/* All of the text is one, and finite.  A time: decimals are taken apart, so that a
 * nanosecond does not get lost beside 1e9 seconds; 0 to 4e9 s. */
bool table_number(const char *text, double *out);
bool table_count(const char *text, uint64_t most, uint64_t *out);
bool table_time(const char *text, int64_t *out_ns);

#endif
