/* SPDX-License-Identifier: MIT */
/* recon/lines.h -- coordinates that are the same but for a tolerance become one line. */
#ifndef ANLOS_RECON_LINES_H
#define ANLOS_RECON_LINES_H

#include <stddef.h>
#include <stdint.h>

/* Sorts values[n] and merges those within tolerance of the first of a run into their
 * mean; the means, rising, stand at the start.  Returns how many. */
size_t lines_merge(double *values, size_t n, double tolerance);

/* The line nearest to value. */
uint32_t lines_nearest(const double *lines, size_t n, double value);

#endif
