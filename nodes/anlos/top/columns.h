/* nodes/anlos/top/columns.h -- the columns of the tables of `anlos top`, and which of
 * them a width has room for. */
#ifndef ANLOS_NODES_ANLOS_TOP_COLUMNS_H
#define ANLOS_NODES_ANLOS_TOP_COLUMNS_H

#include <stdbool.h>
#include <stddef.h>

#include "nodes/anlos/top/table.h"
#include "nodes/anlos/text.h"

struct column {
    const char *title; /* NULL ends a list */
    int width;         /* 0: the rest of the line, to the left */
    bool left;
    int rank; /* the highest goes first when there is no room */
    void (*write)(const void *row, char out[TEXT_CELL_SIZE]);
};

struct columns_link_row { /* of columns_links */
    const char *name;     /* the topic's, or the node's */
    const struct table_link *link;
};

extern const struct column columns_nodes[];  /* of struct table_node */
extern const struct column columns_topics[]; /* of struct table_topic */
extern const struct column columns_links[];
extern const struct column columns_objects[]; /* of struct table_object */

/* row NULL: the titles.  Writes a line of at most width columns, without blanks at the
 * end.  The first two columns are always there. */
void columns_write(const struct column *columns, int width, const void *row, char *out,
                   size_t size);

/* Where the second column, the state, begins and how wide it is. */
void columns_state(const struct column *columns, int *at, int *n);

#endif
