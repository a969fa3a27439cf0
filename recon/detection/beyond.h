/* SPDX-License-Identifier: MIT */
/* recon/detection/beyond.h -- which objects of an image are no more than sidelobes, most
 * of all of something that stands beyond its volume.  There it is the brightest thing
 * that is not seen, and what it leaves in the volume is as bright as anything is.  So the
 * volume and what lies around it are imaged once more, coarse
 * (recon/imaging/surroundings.h), and each object is held against the brightest places
 * outside.  Sidelobes of an image of power are as bright as objects wherever what makes
 * them stands: phases do not agree about them. */
#ifndef ANLOS_RECON_DETECTION_BEYOND_H
#define ANLOS_RECON_DETECTION_BEYOND_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/pool.h"
#include "recon/detection/detect.h"
#include "recon/geometry.h"
#include "recon/imaging/surroundings.h"
#include "recon/planning/trace_set.h"

struct beyond {
    const struct geometry *geometry;
    const struct surroundings_view *around;
    double range_db; /* the most that objects of one image may differ by: what is fainter
                      * by that than something else would be none if that were in it */
    bool of_power;
};

/* found [n]: in an image of the volume.  Lowers the existence of those that are fainter,
 * in the coarse image, than something beyond the volume by about range_db or more: by
 * range_db it is even odds, ten to one by 5 dB more or less.  What is outside and fainter
 * than an object inside that may make it is a sidelobe itself. Sidelobes lie where the
 * other is as far away for some of the aperture, and anywhere 20 dB below those.
 * of_power: they lie anywhere, and those of another object of the image are 13 dB below
 * that.  0, -ENOMEM. */
int beyond_judge(const struct beyond *b, struct detection *found, size_t n);

/* The same where the traces are at hand, of which it makes the coarse image; nothing is
 * done where that cannot be.  0, -ENOMEM, -ECANCELED (the pool has stopped). */
int beyond_judge_traces(const struct trace_set *set, const struct grid *volume,
                        double range_db, bool of_power, struct pool *pool,
                        struct detection *found, size_t n);

#endif
