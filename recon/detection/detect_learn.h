/* SPDX-License-Identifier: MIT */
/* recon/detection/detect_learn.h -- teaches a CFAR what noise is, from images with
 * objects in them. One that is far brighter than all else has sidelobes as far away as
 * itself: neither it nor they are noise, and that it is there for long does not make it
 * so.  Clutter has its brightest too, but the next of it is not much fainter: of that all
 * is learnt. */
#ifndef ANLOS_RECON_DETECTION_DETECT_LEARN_H
#define ANLOS_RECON_DETECTION_DETECT_LEARN_H

#include "dsp/cfar.h"
#include "recon/grid.h"

/* intensity [nz][ny][nx]; ranges are counted from the origin of the grid's frame, where
 * the array is.  0, -ENOMEM. */
int detect_learn(struct cfar *c, const struct grid *grid, const float *intensity);

#endif
