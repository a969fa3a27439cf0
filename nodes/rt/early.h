/* nodes/rt/early.h -- what comes before the survey, and of which nobody can make anything
 * yet: processes start as they like, so that is no fault.  It is counted, and said once,
 * when the survey is there. */
#ifndef ANLOS_NODES_RT_EARLY_H
#define ANLOS_NODES_RT_EARLY_H

#include "nodes/rt/node.h"

struct early {
    const char *count; /* its name in health, such as "pings before the survey" */
    uint64_t n, told;
};

/* For node_device; returns 1. */
size_t early_count(const struct early *e, struct device_count *out);

/* The survey is there. */
void early_tell(struct early *e, const struct node *node);

#endif
