/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/export.h -- the formats of `anlos bag export`. */
#ifndef ANLOS_NODES_ANLOS_BAG_EXPORT_H
#define ANLOS_NODES_ANLOS_BAG_EXPORT_H

#include <stdbool.h>
#include <stddef.h>

#include "nodes/anlos/bag/bag.h"
#include "nodes/anlos/bag/stream.h"

struct export_options { /* borrow from argv */
    const char *file, *topics, *out;
    char topics_room[VERB_PATTERNS];
    size_t scan;       /* 0: the last one of the bag */
    bool full;         /* JSON: every number of sound and images; Foxglove: sound */
    const char *scene; /* OSI: of a simulated drive, or NULL */
};

/* Each writes out (all of it or nothing) from the topics that the stream has, and says on
 * stdout what.  0, -EINTR, -ENODATA (the bag holds none of that), -EEXIST, errors of
 * stream_next and of writing. */
int export_lines(struct stream *s, const struct export_options *o, struct error *why);
int export_csv(struct stream *s, const struct export_options *o, struct error *why);
int export_nrrd_file(struct stream *s, const struct export_options *o, struct error *why);

/* Tracks, and who was there, as a trace file of ASAM OSI. */
int export_osi(struct stream *s, const struct export_options *o, struct error *why);

/* Of an array that stands all pings, in a file as long as it takes, and how the vehicle
 * moved.  *n_missing: pings that the recording has not, silent there. */
int export_wav(struct stream *s, const struct export_options *o, size_t *n_missing,
               struct error *why);

#endif
