/* nodes/anlos/top/detail.h -- all that is known of one node or one topic, as text. */
#ifndef ANLOS_NODES_ANLOS_TOP_DETAIL_H
#define ANLOS_NODES_ANLOS_TOP_DETAIL_H

#include <stddef.h>

#include "nodes/anlos/top/page.h"
#include "nodes/anlos/top/table.h"

enum { DETAIL_MAX_LINES = 96 };

struct detail {
    size_t n;
    char lines[DETAIL_MAX_LINES][PAGE_LINE_SIZE];
};

/* What it says, its device's counts, and each of its topics. */
void detail_of_node(struct detail *d, const struct table_node *node, int width);

/* How it is kept, and each node that publishes or receives it. */
void detail_of_topic(struct detail *d, const struct table *t, const struct topic *topic,
                     int width);

#endif
