/* SPDX-License-Identifier: MIT */
/* nodes/rt/optional_node.h -- nodes that a system hears and images without. */
#ifndef ANLOS_NODES_RT_OPTIONAL_NODE_H
#define ANLOS_NODES_RT_OPTIONAL_NODE_H

#include <stdbool.h>

/* Those who only look on may come and go. */
bool optional_node_is(const char *node);

#endif
