/* SPDX-License-Identifier: MIT */
/* hal/realtime.h -- a thread that must not be late: real-time priority and locked memory
 * where the system permits it. */
#ifndef ANLOS_HAL_REALTIME_H
#define ANLOS_HAL_REALTIME_H

#include <pthread.h>
#include <stdbool.h>

#include "dsp/error.h"

/* Above everything that is not urgent, under the kernel's interrupt threads (50). */
#define REALTIME_PRIORITY 20

/* Starts run(arg) with all signals blocked: they are the caller's.  urgent: with
 * SCHED_FIFO, and what the process has in memory stays there, also after its end: others
 * may want that too.  Where that is not
 * permitted the thread runs all the same, and the error says what is missing; else it
 * stays as it is.  0 or a negative errno. */
int realtime_start(pthread_t *out, void *(*run)(void *), void *arg, bool urgent,
                   struct error *missing);

/* What the process has in memory stays there, and what it will have too where no limit is
 * in the way.  0, -EPERM, -ENOMEM (the limit), other negative errno. */
int realtime_lock(void);
void realtime_unlock(void);

#endif
