/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "nodes/rt/health.h"
#include "tests/nodes/near.h"

#define S 1000000000LL

static int set_up(void **state)
{
    *state = calloc(1, sizeof(struct latencies));
    return *state ? 0 : -1;
}

static int tear_down(void **state)
{
    free(*state);
    return 0;
}

/* Milliseconds 100, 99 ... 1. */
static void median_and_p99_are_the_nearest_ranks(void **state)
{
    struct latencies *l = *state;
    const int64_t now = 1000 * S;

    for (int i = 1; i <= 100; i++)
        latencies_add(l, topic_ping(), true, now, now - (101 - i) * (S / 1000));
    struct latency_summary s = latencies_summarise(l, topic_ping(), true, now);
    assert_int_equal(s.n, 100);
    assert_near(s.median_s, 0.050, 1e-12);
    assert_near(s.p99_s, 0.099, 1e-12);

    latencies_add(l, topic_traces(), false, now, now - 3 * S);
    s = latencies_summarise(l, topic_traces(), false, now);
    assert_int_equal(s.n, 1);
    assert_near(s.median_s, 3, 1e-12);
    assert_near(s.p99_s, 3, 1e-12);
}

static void what_came_in_and_what_went_out_are_kept_apart(void **state)
{
    struct latencies *l = *state;

    latencies_add(l, topic_ping(), false, 10 * S, 9 * S);
    assert_int_equal(latencies_summarise(l, topic_ping(), true, 10 * S).n, 0);
    assert_int_equal(latencies_summarise(l, topic_traces(), false, 10 * S).n, 0);
    assert_int_equal(latencies_summarise(l, topic_ping(), false, 10 * S).n, 1);
}

static void what_is_older_than_the_window_does_not_count(void **state)
{
    struct latencies *l = *state;

    latencies_add(l, topic_ping(), true, 10 * S, 2 * S);
    latencies_add(l, topic_ping(), true, 14 * S, 13 * S);
    assert_int_equal(latencies_summarise(l, topic_ping(), true, 15 * S - 1).n, 2);
    assert_int_equal(latencies_summarise(l, topic_ping(), true, 15 * S).n, 1);
    assert_near(latencies_summarise(l, topic_ping(), true, 15 * S).p99_s, 1, 1e-12);
    assert_int_equal(latencies_summarise(l, topic_ping(), true, 20 * S).n, 0);
    /* A replayed clock was set back. */
    assert_int_equal(latencies_summarise(l, topic_ping(), true, 12 * S).n, 1);
}

static void only_the_newest_are_kept(void **state)
{
    struct latencies *l = *state;

    for (int i = 0; i < LATENCIES_DEPTH; i++)
        latencies_add(l, topic_ping(), true, 10 * S, 1 * S);
    for (int i = 0; i < LATENCIES_DEPTH; i++)
        latencies_add(l, topic_ping(), true, 10 * S, 8 * S);
    struct latency_summary s = latencies_summarise(l, topic_ping(), true, 10 * S);
    assert_int_equal(s.n, LATENCIES_DEPTH);
    assert_near(s.p99_s, 2, 1e-12);
}

static void a_message_of_no_sound_has_no_latency(void **state)
{
    struct latencies *l = *state;

    latencies_add(l, topic_health(), true, 10 * S, 0);
    assert_int_equal(l->n, 0);
}

static void more_topics_than_there_is_room_for_are_left_out(void **state)
{
    struct latencies *l = *state;
    size_t n = 0;

    for (int published = 0; published < 2; published++)
        for (const struct topic *t = topics_all(); t->name; t++, n++)
            latencies_add(l, t, published, 10 * S, 9 * S);
    assert_true(n > LATENCIES_MAX_TOPICS);
    assert_int_equal(l->n, LATENCIES_MAX_TOPICS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(median_and_p99_are_the_nearest_ranks, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(what_came_in_and_what_went_out_are_kept_apart,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(what_is_older_than_the_window_does_not_count,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(only_the_newest_are_kept, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_message_of_no_sound_has_no_latency, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(more_topics_than_there_is_room_for_are_left_out,
                                        set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
