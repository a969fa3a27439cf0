/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm_shrink.h -- inside the iterations: shrinkage and dual, voxel by
 * voxel (Boyd 2011, 4.4.3 and 6.5.1), on rows that recon/inverse/admm_split.c lays out.
 */
#ifndef ANLOS_RECON_INVERSE_ADMM_SHRINK_H
#define ANLOS_RECON_INVERSE_ADMM_SHRINK_H

#include "recon/inverse/admm_plan.h"

/* Where a part of a row comes from and goes to, [nx] each; those of different parts do
 * not overlap.  change, dual, gap and z only count in a checked round. */
struct admm_part_row {
    const float *ax, *before;       /* A x; v */
    float *after, *g;               /* v; 2 z - v */
    float *change, *dual, *gap, *z; /* z - the z before; u; A x - z; z */
};

/* parts[a->parts]: after and g. */
void admm_shrink_row(const struct admm *a, const struct admm_part_row *parts);

/* What the stopping rule looks at, of rows that have been shrunk; gap, ax and z are added
 * to norms. */
void admm_compare_row(const struct admm *a, const struct admm_part_row *parts,
                      struct admm_norms *norms);

/* |x|^2 */
double admm_squares(const float *x, size_t n);

/* Keeps z and the unscaled dual of all voxels when rho changes. */
void admm_shrink_rescale(struct admm *a, double rho);

#endif
