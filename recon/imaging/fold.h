/* SPDX-License-Identifier: MIT */
/* recon/imaging/fold.h -- what is the same but for a tolerance counts once: coordinates
 * that are one line, traces that share a midpoint. */
#ifndef ANLOS_RECON_IMAGING_FOLD_H
#define ANLOS_RECON_IMAGING_FOLD_H

#include <stddef.h>
#include <stdint.h>

#include "recon/geometry.h"

/* Sorts values[n] and merges those within tolerance of the first of a run into their
 * mean; the means, rising, stand at the start.  Returns how many. */
size_t lines_merge(double *values, size_t n, double tolerance);

/* The line nearest to value. */
uint32_t lines_nearest(const double *lines, size_t n, double value);

/* cell[position][speaker][microphone]: the number of the trace's midpoint, those within
 * 1 mm of each other being one; *n_cells: how many there are.  0, -ENOMEM. */
int fold_number(const struct geometry *g, uint32_t *cell, size_t *n_cells);

/* [position][speaker][microphone]: one over how many traces share the trace's midpoint;
 * free() it.  0, -ENOMEM. */
int fold_weights(const struct geometry *g, float **weight);

#endif
