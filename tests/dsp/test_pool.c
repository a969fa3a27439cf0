/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>

#include "dsp/pool.h"

#define N 10000

struct tally {
    atomic_uint seen[N];
    size_t n_threads;
    atomic_bool stranger;
};

static void count_item(void *ctx, size_t item, size_t thread)
{
    struct tally *t = ctx;

    atomic_fetch_add(&t->seen[item], 1);
    if (thread >= t->n_threads)
        atomic_store(&t->stranger, true);
}

static void check(size_t n_threads, size_t n_items)
{
    struct tally *t = calloc(1, sizeof(*t));
    struct pool *p;

    assert_non_null(t);
    t->n_threads = n_threads;
    assert_int_equal(pool_create(&p, n_threads), 0);
    assert_int_equal(pool_threads(p), n_threads);
    pool_run(p, n_items, count_item, t);
    pool_destroy(p);
    for (size_t i = 0; i < N; i++)
        assert_int_equal(atomic_load(&t->seen[i]), i < n_items ? 1 : 0);
    assert_false(atomic_load(&t->stranger));
    free(t);
}

static void every_item_is_worked_on_exactly_once(void **state)
{
    (void)state;
    check(4, N);
    check(2, N - 1);
}

static void there_may_be_more_threads_than_items(void **state)
{
    (void)state;
    check(8, 3);
    check(8, 1);
    check(8, 0);
}

static void one_thread_is_the_caller_himself(void **state)
{
    (void)state;
    check(1, 100);
}

static void add_item(void *ctx, size_t item, size_t thread)
{
    unsigned long *sums = ctx; /* [threads], a cache line apart */

    sums[8 * thread] += item;
}

/* Results of one run are seen by the next and by the caller without further locks. */
static void many_short_runs_in_a_row_lose_nothing(void **state)
{
    unsigned long sums[3 * 8] = {0};
    struct pool *p;

    (void)state;
    assert_int_equal(pool_create(&p, 3), 0);
    for (int i = 0; i < 2000; i++)
        pool_run(p, 7, add_item, sums);
    pool_destroy(p);
    assert_int_equal(sums[0] + sums[8] + sums[16], 2000 * 21);
}

struct meeting {
    pthread_barrier_t barrier;
};

static void meet(void *ctx, size_t item, size_t thread)
{
    struct meeting *m = ctx;

    (void)item;
    (void)thread;
    pthread_barrier_wait(&m->barrier);
}

/* Ends only if four items are under way at the same time; the test's time limit is the
 * deadline. */
static void the_threads_work_at_the_same_time(void **state)
{
    struct meeting m;
    struct pool *p;

    (void)state;
    assert_int_equal(pthread_barrier_init(&m.barrier, NULL, 4), 0);
    assert_int_equal(pool_create(&p, 4), 0);
    pool_run(p, 4, meet, &m);
    pool_destroy(p);
    pthread_barrier_destroy(&m.barrier);
}

struct masks {
    struct meeting meeting; /* so that every thread has an item */
    int blocked[4];
};

static void read_mask(void *ctx, size_t item, size_t thread)
{
    struct masks *m = ctx;
    sigset_t mask;

    meet(&m->meeting, item, thread);
    m->blocked[thread] = pthread_sigmask(SIG_SETMASK, NULL, &mask) == 0 &&
                         sigismember(&mask, SIGTERM);
}

/* Else a sleep of the caller's would not end when the process is asked to stop. */
static void signals_are_left_to_the_caller(void **state)
{
    struct masks m = {0};
    struct pool *p;

    (void)state;
    assert_int_equal(pthread_barrier_init(&m.meeting.barrier, NULL, 4), 0);
    assert_int_equal(pool_create(&p, 4), 0);
    pool_run(p, 4, read_mask, &m);
    pool_destroy(p);
    pthread_barrier_destroy(&m.meeting.barrier);
    assert_false(m.blocked[0]);
    for (int i = 1; i < 4; i++)
        assert_true(m.blocked[i]);
}

struct stopper { /* says yes at question number `at`, from 0 */
    size_t asked, at;
    pthread_t caller;
    bool elsewhere;
};

static bool stop_at(void *ctx)
{
    struct stopper *s = ctx;

    s->elsewhere |= !pthread_equal(pthread_self(), s->caller);
    return s->asked++ >= s->at;
}

static size_t items_done(const struct tally *t)
{
    size_t n = 0;

    for (size_t i = 0; i < N; i++)
        n += atomic_load(&t->seen[i]);
    return n;
}

static void what_has_not_begun_when_it_is_to_stop_is_left_out(void **state)
{
    struct tally *t = calloc(1, sizeof *t);
    struct stopper s = {.at = 3, .caller = pthread_self()};
    struct pool *p;

    (void)state;
    assert_non_null(t);
    t->n_threads = 1;
    assert_int_equal(pool_create(&p, 1), 0);
    pool_stop_by(p, stop_at, &s);
    pool_run(p, N, count_item, t);
    assert_int_equal(items_done(t), 3);
    assert_int_equal(s.asked, 4);
    assert_true(pool_stopped(p));
    pool_run(p, N, count_item, t);
    assert_int_equal(items_done(t), 3);
    assert_int_equal(s.asked, 4); /* it has said so */
    pool_stop_by(p, NULL, NULL);
    assert_false(pool_stopped(p));
    pool_run(p, N, count_item, t);
    assert_int_equal(items_done(t), N + 3);
    pool_destroy(p);
    free(t);
}

/* How much the others do before the caller has asked is theirs; what comes after it is
 * left out by all. */
static void only_the_caller_is_asked_and_all_threads_stop(void **state)
{
    struct tally *t = calloc(1, sizeof *t);
    struct stopper s = {.at = 0, .caller = pthread_self()};
    struct pool *p;

    (void)state;
    assert_non_null(t);
    t->n_threads = 4;
    assert_int_equal(pool_create(&p, 4), 0);
    pool_stop_by(p, stop_at, &s);
    assert_true(pool_stopped(p));
    pool_run(p, N, count_item, t);
    assert_int_equal(items_done(t), 0);
    s = (struct stopper){.at = SIZE_MAX, .caller = pthread_self()};
    pool_stop_by(p, stop_at, &s);
    pool_run(p, N, count_item, t);
    assert_int_equal(items_done(t), N);
    assert_false(s.elsewhere);
    assert_false(pool_stopped(p));
    pool_destroy(p);
    free(t);
}

static void no_threads_or_absurdly_many_are_refused(void **state)
{
    struct pool *p = NULL;

    (void)state;
    assert_int_equal(pool_create(&p, 0), -EINVAL);
    assert_int_equal(pool_create(&p, POOL_MAX_THREADS + 1), -EINVAL);
    assert_int_equal(pool_create(NULL, 1), -EINVAL);
    assert_null(p);
    pool_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_item_is_worked_on_exactly_once),
        cmocka_unit_test(there_may_be_more_threads_than_items),
        cmocka_unit_test(one_thread_is_the_caller_himself),
        cmocka_unit_test(many_short_runs_in_a_row_lose_nothing),
        cmocka_unit_test(the_threads_work_at_the_same_time),
        cmocka_unit_test(signals_are_left_to_the_caller),
        cmocka_unit_test(what_has_not_begun_when_it_is_to_stop_is_left_out),
        cmocka_unit_test(only_the_caller_is_asked_and_all_threads_stop),
        cmocka_unit_test(no_threads_or_absurdly_many_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
