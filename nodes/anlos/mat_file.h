/* SPDX-License-Identifier: MIT */
/* nodes/anlos/mat_file.h -- numeric arrays of MATLAB files, v5 and v7.3 (libmatio, in a
 * forked process of its own).
 *
 * Data are handed out in MATLAB's order, first index fastest: element (i, j, k) of an
 * array of extents [a][b][c] is out[i + a * (j + b * k)].  Any integer or real class is
 * converted; logical too; sparse arrays, cells and structures are refused.  To
 * be called while the process has one thread.
 */
#ifndef ANLOS_NODES_ANLOS_MAT_FILE_H
#define ANLOS_NODES_ANLOS_MAT_FILE_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"

#define MAT_FILE_MAX_RANK     4
#define MAT_FILE_MAX_ELEMENTS ((size_t)1 << 28)

struct mat_file;

/* 0, -ENOENT and other errno of reading, -EIO (truncated or damaged), -EINVAL (no such
 * MATLAB file), -ENOMEM, errors of fork(2). */
int mat_file_open(struct mat_file **out, const char *path, struct error *why);
bool mat_file_has(struct mat_file *f, const char *name);

/* Size of a variable without reading its data; it may have no more than `rank`
 * dimensions, 2..MAT_FILE_MAX_RANK (MATLAB drops trailing ones: they come as 1).  The
 * error is "path: name: what was expected".
 * 0, -ENOENT (no such variable), -EINVAL, -EFBIG (MAT_FILE_MAX_ELEMENTS). */
int mat_file_extents(struct mat_file *f, const char *name, size_t rank, size_t extents[],
                     struct error *why);

/* The whole variable; free(*out).  mat_file_read_complex takes real data as well, the
 * other two refuse complex.  As mat_file_extents, and -ENOMEM, -EIO (truncated). */
int mat_file_read_float(struct mat_file *f, const char *name, size_t rank,
                        size_t extents[], float **out, struct error *why);
int mat_file_read_double(struct mat_file *f, const char *name, size_t rank,
                         size_t extents[], double **out, struct error *why);
int mat_file_read_complex(struct mat_file *f, const char *name, size_t rank,
                          size_t extents[], float complex **out, struct error *why);

/* A single finite number. */
int mat_file_read_number(struct mat_file *f, const char *name, double *out,
                         struct error *why);
void mat_file_close(struct mat_file *f);

#endif
