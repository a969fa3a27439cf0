/* SPDX-License-Identifier: MIT */
/* nodes/record/record.h -- the node record: what comes over a bus that keeps all goes
 * into a bag, until it is asked to end, or cannot write any more; the rest of the system
 * goes on. */
#ifndef ANLOS_NODES_RECORD_RECORD_H
#define ANLOS_NODES_RECORD_RECORD_H

#include "nodes/rt/loop.h"

struct record;

extern const struct loop record_loop; /* closes it */

/* As the node's launch file says; the node is not owned.  0, or a negative errno with an
 * error. */
int record_open(struct record **out, struct node *node, struct error *why);

#endif
