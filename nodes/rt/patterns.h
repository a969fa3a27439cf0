/* SPDX-License-Identifier: MIT */
/* nodes/rt/patterns.h -- names chosen by patterns (fnmatch(3)) with commas between, as
 * in "survey,stage*". */
#ifndef ANLOS_NODES_RT_PATTERNS_H
#define ANLOS_NODES_RT_PATTERNS_H

#include <stdbool.h>

#define PATTERN_SIZE 64

/* The first pattern in out (what does not fit is cut), and what follows it.  NULL: there
 * is none. */
const char *patterns_next(const char *patterns, char out[PATTERN_SIZE]);

/* NULL: every name. */
bool patterns_match(const char *patterns, const char *name);

#endif
