/* SPDX-License-Identifier: MIT */
#include "nodes/rt/heap.h"

#include <malloc.h>
#include <stddef.h>
#include <stdlib.h>

#define KEPT_BYTES ((size_t)1 << 20) /* free at the heap's end, at least */

/* Left to itself glibc gives each thread a heap of its own, of which each keeps what its
 * own peak took: messages that waited while the process did not run.  A thread's cannot
 * even be made smaller where memory is locked (hal/realtime.h): glibc leaves it to
 * madvise(2), which refuses then.  That of the process can.
 *
 * But not for each message anew, whose pages cost ten times what it takes to fill them.
 * What may stay at the end is twice the largest block by itself that was freed, and no
 * setting that would not keep it from growing with larger messages. */
void heap_share(void)
{
    mallopt(M_ARENA_MAX, 1);
    void *volatile block = malloc(KEPT_BYTES / 2);
    free(block);
}
