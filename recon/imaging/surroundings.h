/* SPDX-License-Identifier: MIT */
/* recon/imaging/surroundings.h -- a coarse look (recon/imaging/coarse.h) at a volume and
 * at what lies around it: on each side a third of the range, where the grating lobes of
 * 20 degrees come from, before it and behind it 25 cm. */
#ifndef ANLOS_RECON_IMAGING_SURROUNDINGS_H
#define ANLOS_RECON_IMAGING_SURROUNDINGS_H

#include <stddef.h>

#include "recon/imaging/imager.h"

enum { SURROUNDINGS_SPOTS = 256 };

struct surroundings_view {
    struct grid grid;       /* of the volume, coarse */
    const float *intensity; /* [nz][ny][nx] of it, by `fast`; NULL: not looked at */
    size_t n_spots;
    const float (*spots)[4]; /* the brightest places beyond the volume, each brighter than
                              * what is next to it, brightest first: x, y, z in the array
                              * frame, m, and how bright it is, in the units of
                              * intensity */
};

struct surroundings;

/* Of the image that is wanted, in its pool, by the traces that it takes.  0, -ENOTSUP (an
 * array that `fast` does not image, pings with places of their own, or more than ten
 * million voxels), -EINVAL, -ENOMEM, -ECANCELED (the pool has stopped).  Free with
 * surroundings_destroy. */
int surroundings_create(struct surroundings **out, const struct imager_config *wanted);

/* Takes the traces; owned by it. */
struct imager *surroundings_imager(struct surroundings *s);

/* Images what is in.  Borrowed, good until the next call; NULL: the pool has stopped.
 * Cost: an image of some 100 voxels a side for a volume as wide as it is far. */
const struct surroundings_view *surroundings_image(struct surroundings *s);

void surroundings_destroy(struct surroundings *s);

#endif
