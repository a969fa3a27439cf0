/* SPDX-License-Identifier: MIT */
/* nodes/rt/process.h -- what this process has of its machine: its processors, one heap,
 * and a priority. */
#ifndef ANLOS_NODES_RT_PROCESS_H
#define ANLOS_NODES_RT_PROCESS_H

#include <stddef.h>

#include "dsp/error.h"
#include "nodes/rt/launchfile.h"

/* Processors that it may use (sched_setaffinity(2), taskset(1), cpusets), at least 1: as
 * many threads keep them busy. */
size_t processors_usable(void);

/* One heap for all threads, so that the memory of what runs for days stays level.  Before
 * the first of them is started; not for what allocates much on several of them at a
 * time. */
void heap_share(void);

/* Gives back what is free in the heap, also below blocks that stay: a small one that came
 * last keeps what a pile of messages took.  For who has such blocks and runs for days,
 * every few seconds.  Where memory is locked it is the heap's end alone. */
void heap_trim(void);

/* Who computes first on a busy machine: the processes of an array that stands have
 * real-time priorities (SCHED_FIFO) and locked memory where the system permits it, in the
 * order of how little a delay of theirs may be; else they are nice to nobody
 * (setpriority(2)) where at least that is permitted; else they are as any.
 *
 * recon computes most and never gets a real-time priority, nor do its threads; view and
 * report wait for all others.  One of which a thread computes for a second without a
 * pause loses its priority (RLIMIT_RTTIME), and the kernel leaves a part of each core to
 * others whatever happens (sched_rt_runtime_us): the machine stays usable. */

#define PRIORITY_TEXT_SIZE 48

/* Does the launch file ask for it?  Not for scans, which may take their time, replays,
 * and what is simulated as fast as it goes. */
bool priority_wanted(const struct launchfile *l);

/* Are real-time priorities and locked memory permitted to this process?  Tried, and left
 * as it was.  0, or -EPERM with an error that says what is not, and what to do. */
int priority_permitted(struct error *why);

/* To be called before this process has other threads: they inherit it.  text: what it
 * has now, such as "fifo 10, locked".  0, or -EPERM where it is required and not
 * permitted. */
int priority_take(const struct launchfile *l, const char *node,
                  char text[PRIORITY_TEXT_SIZE], struct error *why);

/* Has it lost its priority, by computing too long?  Its other threads keep theirs until
 * priority_drop, to be called then by its main loop. */
bool priority_is_lost(void);
void priority_drop(void);

#endif
