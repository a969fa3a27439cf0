/* SPDX-License-Identifier: MIT */
/* recon/tracking/sidelobes.h -- sidelobes of an array look like objects: fainter, and as
 * far away as what makes them, for an array tells ranges well and bearings badly.  What
 * is about as far as something so much louder, be it imaged beside it or a track that has
 * just left the image, is not tracked: an object that is there itself coasts past.
 *
 * How far that is depends on who listens: an element e off the middle of the array hears
 * what is far away in direction u nearer by e u than the middle does, and in direction u'
 * by e u'.  Its sidelobes in u' are off by e (u - u').  The other elements cancel most of
 * them, but what comes out from behind the end of the gate is not heard by all. */
#ifndef ANLOS_RECON_TRACKING_SIDELOBES_H
#define ANLOS_RECON_TRACKING_SIDELOBES_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/survey.h"

struct sidelobe_source {
    double range_m;      /* of its image, from the array */
    double direction[3]; /* there from the array, of length 1 */
    double level_db;
};

struct sidelobe_array {
    double half_m[3]; /* from its middle to its ends, along each axis of its frame */
    double gate_m;    /* where it ends */
    double margin_db;
};

/* half_m of an array without a stage, from its elements, and gate_m. */
void sidelobe_array_measure(struct sidelobe_array *array, const struct survey *s);

/* virtual_m: in the array frame, from its origin. */
struct sidelobe_source sidelobe_source_at(const double virtual_m[3], double level_db);

/* Is something fainter by margin_db or more than one of sources[n] that may be heard at
 * its range? */
bool sidelobes_may_be(const struct sidelobe_array *array,
                      const struct sidelobe_source *what,
                      const struct sidelobe_source *sources, size_t n);

#endif
