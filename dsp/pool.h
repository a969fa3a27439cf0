/* SPDX-License-Identifier: MIT */
/* dsp/pool.h -- a few threads that stay: starting threads for each call costs more than
 * most of our loops. */
#ifndef ANLOS_DSP_POOL_H
#define ANLOS_DSP_POOL_H

#include <stdbool.h>
#include <stddef.h>

struct pool;

#define POOL_MAX_THREADS 1024

/* n_threads, 1..POOL_MAX_THREADS, counts the caller, who works too.  0, -EINVAL, -ENOMEM,
 * -EAGAIN. */
int pool_create(struct pool **out, size_t n_threads);
size_t pool_threads(const struct pool *p);

/* Calls work(ctx, item, thread) for each item 0..n_items-1, spread over the threads, and
 * returns when all are done.  thread is 0..pool_threads-1, for scratch.  Not reentrant.
 * Once the pool has stopped, items that have not begun are left out.
 */
void pool_run(struct pool *p, size_t n_items,
              void (*work)(void *ctx, size_t item, size_t thread), void *ctx);

/* From now on stop(ctx) is asked before each item that the caller's own thread takes, and
 * by pool_stopped; it is called in no other thread.  Once it says yes the pool has
 * stopped, until the next pool_stop_by.  NULL: it never does. */
void pool_stop_by(struct pool *p, bool (*stop)(void *ctx), void *ctx);

/* Asks, in the caller's thread.  Once true, what pool_run has made since pool_stop_by may
 * lack parts and must not be used: a loop of many runs ends. */
bool pool_stopped(struct pool *p);
void pool_destroy(struct pool *p);

#endif
