/* SPDX-License-Identifier: MIT */
/* nodes/view/picture.h -- a volume as a page shows it: 8 bits a voxel on a scale of
 * decibels, its maxima along each axis, and slices across the depth. */
#ifndef ANLOS_NODES_VIEW_PICTURE_H
#define ANLOS_NODES_VIEW_PICTURE_H

#include <stddef.h>
#include <stdint.h>

#include "recon/grid.h"

#define PICTURE_STEP_DB 0.25 /* of one level; full scale is level 255 */

enum picture_side { PICTURE_XY, PICTURE_XZ, PICTURE_YZ, PICTURE_SIDES };

struct picture {
    struct grid grid;
    double peak;                        /* intensity of level 255: full scale, as of
                                         * pictures in files; 0: all is dark */
    double brightest, noise;            /* intensities: what is brightest, up to peak, and
                                         * the median; 0: not known */
    uint8_t *level;                     /* [nz][ny][nx] */
    uint8_t *projection[PICTURE_SIDES]; /* maxima: [ny][nx], [nz][nx], [nz][ny] */
};

/* intensity [nz][ny][nx], a power: level = 255 + 10 log10(intensity / peak) /
 * PICTURE_STEP_DB to within a hundredth of a level before it is rounded, 0 for what is
 * fainter, negative or no number.  Costs about a nanosecond a voxel.  picture_clear it.
 * 0, -EINVAL (no voxels), -ENOMEM. */
int picture_create(struct picture *out, const struct grid *grid, const float *intensity);

/* Bytes of a side, and its extents across and up. */
size_t picture_side_size(const struct picture *p, enum picture_side side, size_t n[2]);

/* The slice at depth index k < nz: [ny][nx], borrowed. */
const uint8_t *picture_slice(const struct picture *p, size_t k);
void picture_clear(struct picture *p);

#endif
