/* SPDX-License-Identifier: MIT */
/* recon/imaging/coarse.h -- a quick look at a scene: an image by the lower half of the
 * band (waves are the cube of it, so a tenth of the work), by steps that suit points as
 * wide as that leaves them. */
#ifndef ANLOS_RECON_IMAGING_COARSE_H
#define ANLOS_RECON_IMAGING_COARSE_H

#include "recon/imaging/imager.h"

/* *look: like the image that is wanted, of the same extent, but coarse: its band, up to
 * 0.45 of the top or an octave where that is more of it, and its grid, which stays as it
 * is where it is coarse already.  By `fast`, without options. */
void coarse_view(const struct imager_config *wanted, struct imager_config *look);

/* Tapered, without dip moveout.  As imager_create. */
int coarse_create(struct imager **out, const struct imager_config *look);

#endif
