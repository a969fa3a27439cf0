/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/image.h -- a volume that is to be converted: its grid, its brightness
 * and the wall that mirrors it. */
#ifndef ANLOS_NODES_FOXGLOVE_IMAGE_H
#define ANLOS_NODES_FOXGLOVE_IMAGE_H

#include <stddef.h>

#include "nodes/foxglove/message.h"
#include "nodes/rt/setting.h"
#include "recon/grid.h"

/* How bright the voxels of an image are, in a histogram: what stands out of the noise,
 * and is not too much to show. */

#define LEVEL_RANGE_DB 20.0 /* below the brightest: sidelobes start there */
#define LEVEL_FLOOR_DB 14.0 /* above the median: one voxel of noise in 10^7 */

struct levels {
    float brightest; /* 0: nothing is there */
    float threshold; /* of what stands out */
    size_t n;        /* how many do */
};

/* intensity[n], of power; what is not finite or negative counts as 0.  At most max of
 * them stand out; of 0 it is quicker. */
void levels_measure(struct levels *out, const float *intensity, size_t n, size_t max);

/* In dB of the brightest, no less than least_db. */
float level_db(const struct levels *l, float intensity, float least_db);

struct image { /* borrows from the message and the setting */
    struct grid grid;
    const float *intensity; /* [nz][ny][nx] */
    struct levels levels;
    const struct wall *wall; /* NULL: none is known */
};

/* At most max voxels are to stand out.  0, -EAGAIN (the survey is not that of the
 * volume), -EINVAL (it does not hold). */
int image_open(struct image *out, const struct setting *s,
               const struct foxglove_message *m, size_t max);

#endif
