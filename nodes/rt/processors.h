/* SPDX-License-Identifier: MIT */
/* nodes/rt/processors.h -- the machine's processors, as far as this process has them. */
#ifndef ANLOS_NODES_RT_PROCESSORS_H
#define ANLOS_NODES_RT_PROCESSORS_H

#include <stddef.h>

/* That this process may use (sched_setaffinity(2), taskset(1), cpusets), at least 1: as
 * many threads keep them busy. */
size_t processors_usable(void);

#endif
