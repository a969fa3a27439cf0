/* SPDX-License-Identifier: MIT */
/* nodes/anlos/speed_error/names.h -- lists of names: each ended by a zero, an empty one
 * at the end, as imager_methods(). */
#ifndef ANLOS_NODES_ANLOS_SPEED_ERROR_NAMES_H
#define ANLOS_NODES_ANLOS_SPEED_ERROR_NAMES_H

#include <stdbool.h>

#include "dsp/error.h"

bool bench_names_have(const char *list, const char *name);

/* Is it the name of a scene file? */
bool bench_names_file(const char *name);

/* A list of names with commas; free() it.  NULL: no memory. */
char *bench_names_split(const char *text);

/* Are all known?  what: "scene" (scene files are, too) or "method".  0, -ENOENT (the
 * error has the list), -EINVAL (none is there). */
int bench_names_check(const char *what, const char *names, const char *known,
                      struct error *why);

/* imager_methods() and auto.  free() it.  NULL: no memory. */
char *bench_names_all_methods(void);

/* The methods that were asked for with commas, checked; NULL: the usual ones, or all of
 * `known` where that is NULL too.  free() *out, also after an error.  0, -ENOENT,
 * -EINVAL, -ENOMEM. */
int bench_names_methods(char **out, const char *asked, const char *usual,
                        const char *known, struct error *why);

#endif
