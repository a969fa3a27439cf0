/* SPDX-License-Identifier: MIT */
/* recon/coherent/midpoint.h -- sort source-receiver pairs by midpoint and offset (Lindell
 * 2019, 3.3).  Midpoints must lie on a product of lines, x_m[nx] times y_m[ny], in one
 * plane; the lines need not be evenly spaced.
 *
 * On a stage that does not stop each speaker has lines of x of its own, so much further
 * on (recon/geometry.h): n_places times as many, of which each has midpoints at some of y
 * only. */
#ifndef ANLOS_RECON_COHERENT_MIDPOINT_H
#define ANLOS_RECON_COHERENT_MIDPOINT_H

#include <stddef.h>
#include <stdint.h>

#include "recon/geometry.h"

struct midpoints {
    size_t nx, ny;
    size_t n_places;   /* 1, or the speakers */
    double *x_m, *y_m; /* [n_places][nx / n_places], rising in each; [ny], rising */
    size_t (
        *x_range)[2]; /* [ny]: midpoints of y stand from which x on, and before which */
    double plane_z_m;
    size_t n_pairs;        /* speakers x microphones */
    uint32_t *ix, *iy;     /* [position][speaker][microphone] */
    size_t n_offsets;      /* different half-offsets */
    double *half_offset_m; /* [n_offsets] */
    uint32_t *offset;      /* [speaker][microphone] */
};

/* 0, -ENOTSUP (*why: what the geometry lacks), -ENOMEM. */
int midpoints_create(struct midpoints **out, const struct geometry *g, const char **why);
void midpoints_destroy(struct midpoints *m);

#endif
