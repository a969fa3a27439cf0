/* nodes/anlos/top/history.h -- what a process had counted at times of the last seconds,
 * so that rates can be told from counts. */
#ifndef ANLOS_NODES_ANLOS_TOP_HISTORY_H
#define ANLOS_NODES_ANLOS_TOP_HISTORY_H

#include "nodes/anlos/top/table.h"

enum { HISTORY_DEPTH = 8 };

#define HISTORY_SPACING_NS                                                               \
    450000000LL                        /* a node that changes its state says so at once  \
                                        */
#define HISTORY_WINDOW_NS 3500000000LL /* three of the usual second, and their jitter */

struct history_sample {
    int64_t at_ns;
    double cpu_s;
    struct {
        uint64_t messages, bytes, lost;
    } links[TABLE_MAX_LINKS];
};

struct history { /* zeroed: empty */
    size_t n;    /* ever added; the newest stands at (n - 1) % HISTORY_DEPTH */
    struct history_sample ring[HISTORY_DEPTH];
};

/* A sample that follows the last one within HISTORY_SPACING_NS is ignored. */
void history_add(struct history *h, const struct history_sample *s);

/* Writes into the node what has changed since the oldest sample of the window, links in
 * the order of the samples'. */
void history_rates(const struct history *h, struct table_node *node);

#endif
