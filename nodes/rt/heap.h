/* SPDX-License-Identifier: MIT */
/* nodes/rt/heap.h -- the heap of a process that runs for days, of which the memory is to
 * stay level. */
#ifndef ANLOS_NODES_RT_HEAP_H
#define ANLOS_NODES_RT_HEAP_H

/* One heap for all threads.  Before the first of them is started; not for what allocates
 * much on several of them at a time. */
void heap_share(void);

#endif
