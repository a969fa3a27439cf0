/* SPDX-License-Identifier: MIT */
/* nodes/anlos/node.h -- the verbs of `anlos node`. */
#ifndef ANLOS_NODES_ANLOS_NODE_H
#define ANLOS_NODES_ANLOS_NODE_H

#include <jansson.h>
#include <stdio.h>

#include "nodes/anlos/feed.h"

/* A line for each node. */
void node_list_print(const struct census *c, FILE *f);

#endif
