/* nodes/anlos/top/look.h -- what of the table a person looks at, and how keys change it.
 * Pure: no terminal. */
#ifndef ANLOS_NODES_ANLOS_TOP_LOOK_H
#define ANLOS_NODES_ANLOS_TOP_LOOK_H

#include <stdbool.h>
#include <stddef.h>

#include "nodes/anlos/top/table.h"

enum look_panel {
    LOOK_NODES,
    LOOK_TOPICS,
    LOOK_DETAIL,
    LOOK_LOG,
    LOOK_OBJECTS,
    LOOK_PANELS
};

enum look_sort {                /* the greatest first, but for the first and the last */
                 LOOK_BY_ORDER, /* of msgs/topics.h */
                 LOOK_BY_LOAD,  /* CPU of nodes, bytes of topics */
                 LOOK_BY_RATE,
                 LOOK_BY_LATENCY,
                 LOOK_BY_LOSSES,
                 LOOK_BY_NAME,
                 LOOK_SORTS
};

enum look_key { /* beside the characters themselves */
                LOOK_KEY_UP = 0x110000,
                LOOK_KEY_DOWN,
                LOOK_KEY_PAGE_UP,
                LOOK_KEY_PAGE_DOWN,
                LOOK_KEY_HOME,
                LOOK_KEY_END,
                LOOK_KEY_BACK_TAB,
                LOOK_KEY_BACKSPACE,
                LOOK_KEY_ESCAPE,
};

struct look { /* zeroed: the first look */
    enum look_panel focus;
    bool detail_of_topic;          /* else of the node that is selected */
    char node[ENVELOPE_NODE_SIZE]; /* selected; empty: the first */
    const struct topic *topic;     /* NULL: the first */
    enum look_sort sort;
    bool paused, help, typing;
    char filter[24];    /* a part of the name; empty: all */
    size_t detail_line; /* first line of the detail that is seen */
    size_t object_line; /* first object that is seen */
    size_t log_line;    /* lines of the log below what is seen */
};

/* Takes a key.  true: it means quit. */
bool look_key(struct look *v, const struct table *t, int key);

/* The rows to show, as indices: filtered and sorted.  Returns how many. */
size_t look_nodes(const struct look *v, const struct table *t,
                  size_t order[TABLE_MAX_NODES]);
size_t look_topics(const struct look *v, const struct table *t,
                   size_t order[TABLE_MAX_TOPICS]);

/* Where in the order the selected one stands; 0 when it is not there. */
size_t look_selected_node(const struct look *v, const struct table *t,
                          const size_t *order, size_t n);
size_t look_selected_topic(const struct look *v, const struct table *t,
                           const size_t *order, size_t n);

const char *look_sort_name(enum look_sort sort);

#endif
