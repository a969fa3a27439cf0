/* nodes/track/ghosts.h -- sidelobes of an array look like objects: fainter, and as far
 * away as what makes them, for an array tells ranges well and bearings badly.  What is
 * about as far as something so much louder, be it imaged beside it or a track that has
 * just left the image, is not tracked: an object that is there itself coasts past. */
#ifndef ANLOS_NODES_TRACK_GHOSTS_H
#define ANLOS_NODES_TRACK_GHOSTS_H

#include <stdbool.h>
#include <stddef.h>

struct ghost_source {
    double range_m; /* of its image, from the array */
    double level_db;
};

/* Is something of this range and level fainter than one of sources[n] at its range by
 * margin_db or more? */
bool ghosts_may_be(const struct ghost_source *what, const struct ghost_source *sources,
                   size_t n, double margin_db);

#endif
