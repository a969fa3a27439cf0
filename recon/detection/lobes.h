/* SPDX-License-Identifier: MIT */
/* recon/detection/lobes.h -- which objects of an image are grating lobes.  An aperture
 * whose places are farther apart than half a wavelength agrees with a wrong direction
 * too, another one for each frequency: over a band such lobes smear, but those of what is
 * strong are still as bright as objects.  An object is seen in the same place at all
 * frequencies; a lobe only at those, the highest first, whose waves are short enough for
 * it. */
#ifndef ANLOS_RECON_DETECTION_LOBES_H
#define ANLOS_RECON_DETECTION_LOBES_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/detection/detect.h"
#include "recon/planning/trace_set.h"

/* May there be a sidelobe of one place at the other?  Is that as far away as the first
 * is, for some of the aperture? */
bool lobes_reach(const struct geometry *g, const double from_m[3], const double to_m[3]);

#define LOBES_MAX 64 /* objects; more are left as they are */

/* found [n], as detect_objects leaves them.  Lowers the existence of those that another
 * one may make, and of which less is heard low in the band, all pairs in step, than of
 * that one. */
void lobes_judge(const struct trace_set *set, struct detection *found, size_t n);

/* Without traces: what is seen at a border of the volume may be no more than a sidelobe
 * of what lies beyond, and what else is seen at that range, fainter, another one.  Lowers
 * the existence of that. */
void lobes_suspect(const struct geometry *g, struct detection *found, size_t n);

#endif
