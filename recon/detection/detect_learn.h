/* SPDX-License-Identifier: MIT */
/* recon/detection/detect_learn.h -- teaches a CFAR what noise is, from images with
 * objects in them. One that is far brighter than all else has sidelobes as far away as
 * itself: neither it nor they are noise, and that it is there for long does not make it
 * so.  Clutter has its brightest too, but the next of it is not much fainter: of that all
 * is learnt.  Whose rings are not told from each other, or from his own ends, a tracker
 * knows all the same: he himself is no noise, while his sidelobes are learnt. */
#ifndef ANLOS_RECON_DETECTION_DETECT_LEARN_H
#define ANLOS_RECON_DETECTION_DETECT_LEARN_H

#include <stdbool.h>

#include "dsp/cfar.h"
#include "recon/grid.h"

/* intensity [nz][ny][nx]; ranges are counted from the origin of the grid's frame, where
 * the array is.  known, likewise: where something is that is tracked; NULL: nowhere.  0,
 * -ENOMEM. */
int detect_learn(struct cfar *c, const struct grid *grid, const float *intensity,
                 const bool *known);

#endif
