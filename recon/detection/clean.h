/* SPDX-License-Identifier: MIT */
/* recon/detection/clean.h -- objects that stronger ones hide: what comes from the bright
 * places of an image is taken out of the traces, and the rest is imaged anew.  The model
 * is subtracted from the data, not its smear from the image (Schwab 1984, Cotton-Schwab
 * CLEAN): what goes is the true response of each pair, sidelobes and grating lobes with
 * it.  Its amplitudes are a least-squares fit of all places at once, by a few steps of
 * conjugate gradients, in place of one place after the other (Hogbom 1974). */
#ifndef ANLOS_RECON_DETECTION_CLEAN_H
#define ANLOS_RECON_DETECTION_CLEAN_H

#include "dsp/pool.h"
#include "recon/detection/detect.h"
#include "recon/imaging/imager.h"
#include "recon/planning/trace_set.h"

struct clean {
    const struct trace_set *set; /* what was imaged */
    struct imager *imager;       /* that did; holds what is left of it afterwards */
    struct pool *pool;
    bool burst;      /* its traces were not compressed (recon/detection/plane) */
    bool own_places; /* each ping has places of its own: a plane is looked for, and what
                      * is in front of it; else what stronger objects hide */
};

/* A plane that fills the view (recon/detection/plane) takes the place of all that was
 * found: it is one object, and what else there is stands before it or beside it.
 *
 * cfg, grid, intensity [nz][ny][nx]: of the image; found [*n]: what detect_objects found
 * in it.  Adds, as far as there is room for max, what stands out in the image of the rest
 * where nothing was bright before.  Echoes that took other ways are left over as well:
 * what exists is brighter than the rest of them lets expect, whose tail is taken for a
 * power law (Hill 1975); what is as far away as something stronger by 20 dB is what the
 * model does not explain of that, and existence under 5 % is left out.  Levels are above
 * the noise of the first image.  Nothing is done where noise hides what the strongest
 * could, or a CFAR decides.  0, -ENOMEM, -ECANCELED (the pool has stopped).  Cost: some
 * ten passes of up to 2 million pairs and places, and an image. */
int clean_find(const struct clean *c, const struct detect_config *cfg,
               const struct grid *grid, const float *intensity, struct detection *found,
               size_t max, size_t *n);

#endif
