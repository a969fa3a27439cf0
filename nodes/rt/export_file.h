/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_file.h -- a file that appears whole or not at all: written under a
 * temporary name beside its own, renamed by commit. */
#ifndef ANLOS_NODES_RT_EXPORT_FILE_H
#define ANLOS_NODES_RT_EXPORT_FILE_H

#include <limits.h>
#include <stdio.h>

#include "dsp/error.h"

struct export_file {
    FILE *f;
    char path[PATH_MAX];
    char temporary[PATH_MAX];
};

/* After success, commit or abandon.  0, or a negative errno and an error. */
int export_file_open(struct export_file *e, const char *folder, const char *name,
                     struct error *why);

/* Flushes and renames; on failure (full disk) the temporary file is removed. */
int export_file_commit(struct export_file *e, struct error *why);

/* Removes the temporary file; err is returned, with an error that names the file. */
int export_file_abandon(struct export_file *e, int err, struct error *why);

#endif
