/* SPDX-License-Identifier: MIT */
/* recon/detection/beyond.h -- which objects of an image are no more than sidelobes, most
 * of all of something that stands beyond its volume.  There it is the brightest thing
 * that is not seen, and what it leaves in the volume is as bright as anything is.  So the
 * volume and what lies around it are imaged once more, coarse (recon/planning/probe), and
 * each object is held against the brightest places outside.  Sidelobes of an image of
 * power are as bright as objects wherever what makes them stands: phases do not agree
 * about them. */
#ifndef ANLOS_RECON_DETECTION_BEYOND_H
#define ANLOS_RECON_DETECTION_BEYOND_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/pool.h"
#include "recon/detection/detect.h"
#include "recon/planning/trace_set.h"

/* found [n]: in an image on grid of these traces.  Lowers the existence of those that are
 * fainter, in the coarse image, than something beyond the grid by about range_db or more:
 * the most that objects of one image may differ by, so that they would be none if that
 * were in the image.  What is outside and fainter than an object inside that may make it
 * is a sidelobe itself.  Sidelobes lie where the other is as far away for some of the
 * aperture, and anywhere 20 dB below those.  of_power: they lie anywhere, and those of
 * another object of the image are 15 dB below that.  Nothing is done for an array that
 * `fast` does not image, or pings with places of their own.  0, -ENOMEM.  Cost: an image
 * by the lower half of the band, some 100 voxels a side for a volume as wide as it is
 * far.
 */
int beyond_judge(const struct trace_set *set, const struct grid *grid, double range_db,
                 bool of_power, struct pool *pool, struct detection *found, size_t n);

#endif
