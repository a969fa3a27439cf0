/* SPDX-License-Identifier: MIT */
/* recon/imaging/fold.h -- traces that share a midpoint: each midpoint is to count once.
 */
#ifndef ANLOS_RECON_IMAGING_FOLD_H
#define ANLOS_RECON_IMAGING_FOLD_H

#include <stdint.h>

#include "recon/geometry.h"

/* cell[position][speaker][microphone]: the number of the trace's midpoint, those within
 * 1 mm of each other being one; *n_cells: how many there are.  0, -ENOMEM. */
int fold_number(const struct geometry *g, uint32_t *cell, size_t *n_cells);

/* [position][speaker][microphone]: one over how many traces share the trace's midpoint;
 * free() it.  0, -ENOMEM. */
int fold_weights(const struct geometry *g, float **weight);

#endif
