/* SPDX-License-Identifier: MIT */
/* recon/detection/regions.h -- bright places of a volume: voxels that hang together
 * around a peak, from the strongest peak down. */
#ifndef ANLOS_RECON_DETECTION_REGIONS_H
#define ANLOS_RECON_DETECTION_REGIONS_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/grid.h"

struct region {
    size_t peak;                      /* voxel */
    size_t low[3], high[3];           /* of its body: what is within 6 dB of the peak */
    size_t halo_low[3], halo_high[3]; /* with the smear around it */
    double sum, moment[3];            /* of the body's intensity, in voxels */
    double second[6];                 /* xx xy xz yy yz zz, likewise, about voxel 0 */
};

struct regions {
    struct region *at; /* [n], strongest first */
    size_t n;
};

/* Is a local maximum a peak?  NULL: each is. */
typedef bool (*regions_judge)(void *state, size_t voxel);

/* intensity [nz][ny][nx].  Peaks below threshold are none, nor those that judge rejects.
 * A region closer than cluster_m to a stronger one joins it: its body where it is nearly
 * as strong, else its halo. 0, -ENOMEM; free with regions_clear. */
int regions_find(struct regions *out, const struct grid *grid, const float *intensity,
                 double threshold, double cluster_m, regions_judge judge, void *state);
void regions_clear(struct regions *r);

#endif
