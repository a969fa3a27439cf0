/* SPDX-License-Identifier: MIT */
/* nodes/rt/export_projection.h -- the maximum of a volume along one of its axes. */
#ifndef ANLOS_NODES_RT_EXPORT_PROJECTION_H
#define ANLOS_NODES_RT_EXPORT_PROJECTION_H

#include <stddef.h>

#include "recon/grid.h"

struct projection { /* across and up: the picture's axes, 0..2 for x, y, z */
    int axis[2];
    size_t n[2];
    double origin_m[2], step_m[2];
    float *value; /* [n[1]][n[0]], up rising */
};

/* volume [nz][ny][nx], >= 0; across != up.  Clear with projection_clear.  0, -ENOMEM. */
int projection_create(struct projection *out, const struct grid *grid,
                      const float *volume, int across, int up);

/* The picture on w x h pixels, which cover the cells up to their outer edges: out[h][w],
 * row 0 on top.  Catmull-Rom between samples, the border's value outside, never below 0.
 * 0, -ENOMEM. */
int projection_resample(const struct projection *p, size_t w, size_t h, float *out);

/* The outer edges of the samples' cells. */
void projection_edges(const struct projection *p, int axis, double *min, double *max);
void projection_clear(struct projection *p);

#endif
