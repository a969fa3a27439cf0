/* SPDX-License-Identifier: MIT */
/* recon/grid.h -- the voxels of an image, in the array frame. */
#ifndef ANLOS_RECON_GRID_H
#define ANLOS_RECON_GRID_H

#include <stddef.h>

#include "recon/geometry.h"

struct grid { /* voxel centres: origin + index * step; arrays are [nz][ny][nx] */
    double origin_m[3];
    double step_m[3];
    size_t n[3]; /* x, y, z */
};

static inline size_t grid_size(const struct grid *g)
{
    return g->n[0] * g->n[1] * g->n[2];
}

/* Of a voxel of [n[2]][n[1]][n[0]]: its number along x, y, z. */
void grid_place(const struct grid *g, size_t voxel, size_t at[3]);

/* The voxels beside one, in 26 directions; returns how many there are. */
size_t grid_neighbours(const struct grid *g, size_t voxel, size_t out[26]);

/* The grid when none is asked for: the aperture grown by a margin, the gate in depth, the
 * steps from resolution (Lindell 2019 Eq. 15 and the bandwidth). */
void grid_default(struct grid *out, const struct geometry *g, const double gate_m[2],
                  const double band_hz[2]);

/* min, max, step of x, y, z.  0, -EINVAL (step <= 0, max < min), -EFBIG (over 2^28
 * voxels). */
int grid_from_limits(struct grid *out, const double limits[3][3]);

/* Bounds of the two-way delay in s between any pair and any voxel: of each position the
 * nearest speaker and microphone to the grid's box, and the farthest. */
void grid_delays(const struct grid *grid, const struct geometry *g, double delays_s[2]);

#endif
