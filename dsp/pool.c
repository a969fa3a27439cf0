/* SPDX-License-Identifier: MIT */
#include "dsp/pool.h"

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>

struct worker {
    struct pool *pool;
    size_t thread;
    pthread_t id;
};

struct pool {
    size_t n_threads;
    struct worker *workers; /* [n_threads]; [0] is the caller and has no thread */
    pthread_mutex_t lock;
    pthread_cond_t start, done;
    unsigned long round; /* rises with each run; guarded by lock, like what follows */
    size_t n_busy;
    bool stop;
    void (*work)(void *ctx, size_t item, size_t thread);
    void *ctx;
    size_t n_items;
    atomic_size_t next;
    bool (*asks)(void *ctx); /* pool_stop_by */
    void *asks_ctx;
    atomic_bool stopped;
};

/* Only the caller asks; its workers see what it was answered. */
static bool pool_stops(struct pool *p, size_t thread)
{
    return thread == 0 ? pool_stopped(p)
                       : atomic_load_explicit(&p->stopped, memory_order_relaxed);
}

static void pool_take(struct pool *p, size_t thread)
{
    for (;;) {
        size_t item = atomic_fetch_add_explicit(&p->next, 1, memory_order_relaxed);
        if (item >= p->n_items || pool_stops(p, thread))
            return;
        p->work(p->ctx, item, thread);
    }
}

static void *pool_worker(void *arg)
{
    struct worker *w = arg;
    struct pool *p = w->pool;
    unsigned long seen = 0;

    pthread_mutex_lock(&p->lock);
    for (;;) {
        while (p->round == seen && !p->stop)
            pthread_cond_wait(&p->start, &p->lock);
        if (p->stop)
            break;
        seen = p->round;
        pthread_mutex_unlock(&p->lock);
        pool_take(p, w->thread);
        pthread_mutex_lock(&p->lock);
        if (--p->n_busy == 0)
            pthread_cond_signal(&p->done);
    }
    pthread_mutex_unlock(&p->lock);
    return NULL;
}

/* Ends the threads 1..n_started-1. */
static void pool_join(struct pool *p, size_t n_started)
{
    pthread_mutex_lock(&p->lock);
    p->stop = true;
    pthread_cond_broadcast(&p->start);
    pthread_mutex_unlock(&p->lock);
    for (size_t i = 1; i < n_started; i++)
        pthread_join(p->workers[i].id, NULL);
}

/* Signals are for the threads that ask for them, never for workers. */
static int pool_start(struct pool *p)
{
    sigset_t all, old;
    int err = 0;

    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &old);
    for (size_t i = 1; i < p->n_threads; i++) {
        p->workers[i].pool = p;
        p->workers[i].thread = i;
        err = -pthread_create(&p->workers[i].id, NULL, pool_worker, &p->workers[i]);
        if (err) {
            pool_join(p, i);
            break;
        }
    }
    pthread_sigmask(SIG_SETMASK, &old, NULL);
    return err;
}

int pool_create(struct pool **out, size_t n_threads)
{
    struct pool *p;
    int err;

    if (!out || n_threads < 1 || n_threads > POOL_MAX_THREADS)
        return -EINVAL;
    p = calloc(1, sizeof(*p));
    if (!p)
        return -ENOMEM;
    p->n_threads = n_threads;
    p->workers = calloc(n_threads, sizeof(*p->workers));
    err = p->workers ? 0 : -ENOMEM;
    if (err)
        goto fail_workers;
    err = -pthread_mutex_init(&p->lock, NULL);
    if (err)
        goto fail_lock;
    err = -pthread_cond_init(&p->start, NULL);
    if (err)
        goto fail_start;
    err = -pthread_cond_init(&p->done, NULL);
    if (err)
        goto fail_done;
    err = pool_start(p);
    if (err)
        goto fail_threads;
    *out = p;
    return 0;

fail_threads:
    pthread_cond_destroy(&p->done);
fail_done:
    pthread_cond_destroy(&p->start);
fail_start:
    pthread_mutex_destroy(&p->lock);
fail_lock:
    free(p->workers);
fail_workers:
    free(p);
    return err;
}

size_t pool_threads(const struct pool *p)
{
    return p->n_threads;
}

void pool_run(struct pool *p, size_t n_items,
              void (*work)(void *ctx, size_t item, size_t thread), void *ctx)
{
    if (p->n_threads == 1 || n_items <= 1) {
        for (size_t i = 0; i < n_items && !pool_stopped(p); i++)
            work(ctx, i, 0);
        return;
    }
    pthread_mutex_lock(&p->lock);
    p->work = work;
    p->ctx = ctx;
    p->n_items = n_items;
    atomic_store(&p->next, 0);
    p->n_busy = p->n_threads - 1;
    p->round++;
    pthread_cond_broadcast(&p->start);
    pthread_mutex_unlock(&p->lock);

    pool_take(p, 0);

    pthread_mutex_lock(&p->lock);
    while (p->n_busy > 0)
        pthread_cond_wait(&p->done, &p->lock);
    pthread_mutex_unlock(&p->lock);
}

void pool_stop_by(struct pool *p, bool (*stop)(void *ctx), void *ctx)
{
    p->asks = stop;
    p->asks_ctx = ctx;
    atomic_store(&p->stopped, false);
}

bool pool_stopped(struct pool *p)
{
    if (atomic_load_explicit(&p->stopped, memory_order_relaxed))
        return true;
    if (!p->asks || !p->asks(p->asks_ctx))
        return false;
    atomic_store_explicit(&p->stopped, true, memory_order_relaxed);
    return true;
}

void pool_destroy(struct pool *p)
{
    if (!p)
        return;
    pool_join(p, p->n_threads);
    pthread_cond_destroy(&p->done);
    pthread_cond_destroy(&p->start);
    pthread_mutex_destroy(&p->lock);
    free(p->workers);
    free(p);
}
