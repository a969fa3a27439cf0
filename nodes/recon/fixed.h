/* SPDX-License-Identifier: MIT */
/* nodes/recon/fixed.h -- the recon node's loop for a fixed array: "survey", "traces",
 * "ego", "wall" -> "volume", and in a replay "receipt". */
#ifndef ANLOS_NODES_RECON_FIXED_H
#define ANLOS_NODES_RECON_FIXED_H

#include "nodes/recon/steady.h"
#include "nodes/rt/node.h"

/* Until a signal.  0 or a negative errno, as for node_finish. */
int fixed_run(struct node *node);

#endif
