/* SPDX-License-Identifier: MIT */
/* recon/imaging/resample.h -- a volume on one lattice to another, both in the array
 * frame. */
#ifndef ANLOS_RECON_IMAGING_RESAMPLE_H
#define ANLOS_RECON_IMAGING_RESAMPLE_H

#include "dsp/pool.h"
#include "recon/grid.h"

struct resample;

enum resample_way {
    RESAMPLE_LINEAR, /* trilinear: never below 0 for data that are not, peaks stay on old
                      * voxels */
    RESAMPLE_CUBIC,  /* cubic convolution (Keys 1981): peaks may lie between; undershoots
                      */
};

/* 0 outside the box of the old voxel centres (an axis of one voxel reaches half a step to
 * both sides).  Owns a little scratch: one caller at a time.  0, -EINVAL (an empty
 * lattice, a step that is not above 0), -ENOMEM. */
int resample_create(struct resample **out, const struct grid *from, const struct grid *to,
                    enum resample_way way, struct pool *pool);

/* in: from's [nz][ny][nx]; y: to's, overwritten. */
void resample_volume(struct resample *r, const float *in, float *y);
void resample_destroy(struct resample *r);

#endif
