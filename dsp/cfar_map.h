/* SPDX-License-Identifier: MIT */
/* dsp/cfar_map.h -- a clutter map (Nitzberg 1986): what a background that does not quite
 * fit any more leaves, cell by cell.  An array that rocks by a fraction of a millimetre,
 * or air that warms, leaves a part of each strong echo that stands still: always at the
 * same places, and there only.  Such a place has to be brighter than it mostly is before
 * something new is there.
 *
 * The map keeps, of each cell, the level that it exceeds in CFAR_MAP_RARE of the time, by
 * stochastic approximation in the logarithm: up by CFAR_MAP_UP_DB_S while it is brighter,
 * down by a fraction of that while it is not.  So a thing that passes a cell within half
 * a second raises its level by 3 dB at most however bright it is, and that is gone 2 s
 * later. */
#ifndef ANLOS_DSP_CFAR_MAP_H
#define ANLOS_DSP_CFAR_MAP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CFAR_MAP_RARE    0.2
#define CFAR_MAP_UP_DB_S 6.0

struct cfar_map;

/* 0, -EINVAL, -ENOMEM. */
int cfar_map_create(struct cfar_map **out, size_t n_cells);

/* image [n_cells], >= 0 (0: nothing was imaged there).  The first tells of no cell more
 * than of the middle one: what is brighter may be something new.  What is held [n_cells]
 * is left as it was; NULL: nothing.  An image that is not newer than the one before, or a
 * second and more, tells only of cells that are not known. */
void cfar_map_learn(struct cfar_map *m, const float *image, const bool *held,
                    int64_t stamp_ns);

/* 0: not known. */
double cfar_map_at(const struct cfar_map *m, size_t cell);
void cfar_map_reset(struct cfar_map *m);
void cfar_map_destroy(struct cfar_map *m);

#endif
