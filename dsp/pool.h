/* SPDX-License-Identifier: MIT */
/* dsp/pool.h -- a few threads that stay: starting threads for each call costs more than
 * most of our loops. */
#ifndef ANLOS_DSP_POOL_H
#define ANLOS_DSP_POOL_H

#include <stddef.h>

struct pool;

#define POOL_MAX_THREADS 1024

/* n_threads, 1..POOL_MAX_THREADS, counts the caller, who works too.  0, -EINVAL, -ENOMEM,
 * -EAGAIN. */
int pool_create(struct pool **out, size_t n_threads);
size_t pool_threads(const struct pool *p);

/* Calls work(ctx, item, thread) for each item 0..n_items-1, spread over the threads, and
 * returns when all are done.  thread is 0..pool_threads-1, for scratch.  Not reentrant.
 */
void pool_run(struct pool *p, size_t n_items,
              void (*work)(void *ctx, size_t item, size_t thread), void *ctx);
void pool_destroy(struct pool *p);

#endif
