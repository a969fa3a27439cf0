/* SPDX-License-Identifier: MIT */
/* nodes/anlos/node.h -- the verbs of `anlos node`. */
#ifndef ANLOS_NODES_ANLOS_NODE_H
#define ANLOS_NODES_ANLOS_NODE_H

#include <jansson.h>
#include <stdio.h>

#include "nodes/anlos/feed.h"

/* A line for each node. */
void node_list_print(const struct census *c, FILE *f);

/* All of one node: what it publishes and receives, its queues, losses and endpoints, what
 * its device counts. */
void node_info_print(const struct census_node *n, const char *run_dir, FILE *f);

/* The same for programs; topics and device only when `all` is asked for.  NULL: no
 * memory.
 */
json_t *node_json(const struct census_node *n, bool all);

#endif
