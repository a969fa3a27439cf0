/* SPDX-License-Identifier: MIT */
/* nodes/scan/controller.h -- the node scan: what it hears goes to a scan, or where the
 * array stands to one without end, and the commands and the status of that come back. */
#ifndef ANLOS_NODES_SCAN_CONTROLLER_H
#define ANLOS_NODES_SCAN_CONTROLLER_H

#include "nodes/rt/loop.h"
#include "nodes/scan/fixed_scan.h"
#include "nodes/scan/scan.h"

struct controller {
    struct node *node;              /* not owned */
    struct scan *scan;              /* this one, */
    struct fixed_scan *fixed;       /* or that one: the array stands */
    Anlos__ScanStatus__State state; /* published last; -1: none */
    int64_t status_due_ns;
    int64_t step_due_ns;
};

extern const struct loop controller_loop; /* destroys both */

#endif
