/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/selection.h -- some of the messages of several bags, in the order of
 * their times, into a new bag: what `merge` and `filter` do. */
#ifndef ANLOS_NODES_ANLOS_BAG_SELECTION_H
#define ANLOS_NODES_ANLOS_BAG_SELECTION_H

#include "msgs/bag/catalog.h"
#include "msgs/bag/compression.h"
#include "nodes/anlos/bag/bag.h"

struct selection {
    char *const *files; /* [n_files] */
    size_t n_files;
    const char *topics, *exclude; /* patterns (verb_matches), or NULL */
    char topics_room[VERB_PATTERNS], exclude_room[VERB_PATTERNS]; /* they may lie here */
    double start_s, end_s; /* after the first message of all; end_s may be INFINITY */
    enum bag_compression compression;
    /* Of sound and images (msgs/shuffle.h). */
    enum selection_order { ORDER_KEPT, ORDER_SHUFFLED, ORDER_PLAIN } order;
    const char *out;
};

struct selection_result {
    uint64_t n_messages, n_written;
};

/* 0; -EINVAL (a pattern that no topic matches), -EEXIST, -EINTR (Ctrl-C), errors of
 * msgs/bag.  After an error there is no new file. */
int selection_write(const struct selection *s, struct selection_result *out,
                    struct error *why);

#endif
