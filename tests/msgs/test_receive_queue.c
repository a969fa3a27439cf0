/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <poll.h>

#include "msgs/receive_queue.h"

static const struct topic all_of_three = {.name = "all", .policy = TOPIC_ALL, .depth = 3};
static const struct topic latest = {.name = "latest", .policy = TOPIC_LATEST, .depth = 1};

struct box {
    struct receive_queue *m;
    size_t all, latest;
};

static int open_box(void **state)
{
    static struct box b;
    assert_int_equal(receive_queue_create(&b.m), 0);
    assert_int_equal(receive_queue_add(b.m, &all_of_three, &b.all), 0);
    assert_int_equal(receive_queue_add(b.m, &latest, &b.latest), 0);
    *state = &b;
    return 0;
}

static int close_box(void **state)
{
    receive_queue_destroy(((struct box *)*state)->m);
    return 0;
}

static void put(struct box *b, size_t slot, uint64_t sequence)
{
    struct bus_message m = {.topic = slot == b->all ? &all_of_three : &latest,
                            .envelope = {.sequence = sequence}};
    receive_queue_put(b->m, slot, &m);
}

static uint64_t take(struct box *b)
{
    struct bus_message m;
    assert_int_equal(receive_queue_take(b->m, &m, 0), 0);
    return m.envelope.sequence;
}

static bool readable(struct box *b)
{
    struct pollfd p = {.fd = receive_queue_fd(b->m), .events = POLLIN};
    return poll(&p, 1, 0) == 1;
}

static void messages_of_all_topics_come_in_the_order_of_arrival(void **state)
{
    struct box *b = *state;
    put(b, b->all, 1);
    put(b, b->latest, 2);
    put(b, b->all, 3);
    for (uint64_t i = 1; i <= 3; i++)
        assert_int_equal(take(b), i);
}

static void a_full_queue_drops_its_oldest_and_counts_it(void **state)
{
    struct box *b = *state;
    uint64_t dropped;
    size_t queued;
    for (uint64_t i = 1; i <= 5; i++)
        put(b, b->all, i);
    receive_queue_count(b->m, b->all, &dropped, &queued);
    assert_int_equal(dropped, 2);
    assert_int_equal(queued, 3);
    for (uint64_t i = 3; i <= 5; i++)
        assert_int_equal(take(b), i);
    receive_queue_count(b->m, b->all, &dropped, &queued);
    assert_int_equal(dropped, 2);
    assert_int_equal(queued, 0);
}

static void a_newer_state_replaces_the_one_that_waits(void **state)
{
    struct box *b = *state;
    uint64_t dropped;
    size_t queued;
    put(b, b->latest, 1);
    put(b, b->all, 2);
    put(b, b->latest, 3);
    receive_queue_count(b->m, b->latest, &dropped, &queued);
    assert_int_equal(dropped, 0); /* it is what was asked for */
    assert_int_equal(queued, 1);
    assert_int_equal(take(b), 2);
    assert_int_equal(take(b), 3);
}

static void what_is_replayed_all_waits(void **state)
{
    struct box *b = *state;
    struct bus_message m = {.envelope = {.replayed = true}};

    for (uint64_t i = 1; i <= 5; i++) { /* the queue's depth is 3 */
        m.envelope.sequence = i;
        receive_queue_put(b->m, b->all, &m);
    }
    for (uint64_t i = 1; i <= 5; i++)
        assert_int_equal(take(b), i);
    for (uint64_t i = 1; i <= 5; i++) {
        m.envelope.sequence = i;
        receive_queue_put(b->m, b->latest, &m);
    }
    put(b, b->latest, 6); /* a live one takes the place of one */
    for (uint64_t i = 2; i <= 6; i++)
        assert_int_equal(take(b), i);
    put(b, b->latest, 7);
    put(b, b->latest, 8);
    assert_int_equal(take(b), 8);
}

static void a_flood_of_one_topic_costs_the_others_nothing(void **state)
{
    struct box *b = *state;
    put(b, b->latest, 1000);
    for (uint64_t i = 1; i <= 100; i++)
        put(b, b->all, i);
    assert_int_equal(take(b), 1000);
}

/* Who takes one while three come, the state last, always has something older: the state
 * is put back again and again.  But not for ever, and it is the newest that is read then.
 */
static void a_flood_does_not_hide_a_state_that_is_told_often(void **state)
{
    struct box *b = *state;
    uint64_t at = 0, longest = 0;

    for (uint64_t turn = 1; turn <= 1000; turn++) {
        put(b, b->all, 10000);
        put(b, b->all, 10000);
        put(b, b->latest, turn);
        uint64_t taken = take(b);
        if (taken == 10000)
            continue;
        assert_int_equal(taken, turn);
        longest = turn - at > longest ? turn - at : longest;
        at = turn;
    }
    assert_true(at > 900);
    assert_in_range(longest, 2, 100);
}

static void the_descriptor_is_readable_while_messages_wait(void **state)
{
    struct box *b = *state;
    assert_false(readable(b));
    put(b, b->latest, 1);
    put(b, b->latest, 2);
    assert_true(readable(b));
    put(b, b->all, 3);
    take(b);
    assert_true(readable(b));
    take(b);
    assert_false(readable(b));
}

static void an_empty_box_times_out(void **state)
{
    struct box *b = *state;
    struct bus_message m;
    assert_int_equal(receive_queue_take(b->m, &m, 0), -ETIMEDOUT);
    assert_int_equal(receive_queue_take(b->m, &m, 5), -ETIMEDOUT);
}

static void an_interrupt_comes_before_messages_that_wait(void **state)
{
    struct box *b = *state;
    struct bus_message m;
    put(b, b->all, 1);
    receive_queue_interrupt(b->m);
    assert_int_equal(receive_queue_take(b->m, &m, -1), -ESHUTDOWN);
    assert_int_equal(receive_queue_take(b->m, &m, -1), -ESHUTDOWN);
}

static void an_interrupt_makes_an_empty_box_readable(void **state)
{
    struct box *b = *state;
    struct bus_message m;
    receive_queue_interrupt(b->m);
    assert_true(readable(b));
    assert_int_equal(receive_queue_take(b->m, &m, -1), -ESHUTDOWN);
    assert_true(readable(b));
}

static void an_interrupt_can_be_ended(void **state)
{
    struct box *b = *state;
    put(b, b->all, 1);
    receive_queue_interrupt(b->m);
    receive_queue_resume(b->m);
    assert_true(readable(b));
    assert_int_equal(take(b), 1);
    assert_false(readable(b));
    receive_queue_interrupt(b->m);
    receive_queue_resume(b->m);
    assert_false(readable(b));
    an_empty_box_times_out(state);
}

static void put_bytes(struct box *b, size_t slot, uint64_t sequence, uint32_t bytes)
{
    struct bus_message m = {.topic = slot == b->all ? &all_of_three : &latest,
                            .envelope = {.sequence = sequence, .payload_size = bytes}};
    receive_queue_put(b->m, slot, &m);
}

static void who_must_have_everything_gets_it_whatever_depth_and_policy(void **state)
{
    struct box *b = *state;
    uint64_t dropped;
    size_t queued;
    receive_queue_keep_all(b->m, 1000);
    for (uint64_t i = 0; i < 100; i++)
        put_bytes(b, i % 2 ? b->all : b->latest, i, 10);
    assert_int_equal(receive_queue_waiting_bytes(b->m), 1000);
    receive_queue_count(b->m, b->latest, &dropped, &queued);
    assert_int_equal(dropped, 0);
    assert_int_equal(queued, 50);
    for (uint64_t i = 0; i < 100; i++)
        assert_int_equal(take(b), i);
    assert_int_equal(receive_queue_waiting_bytes(b->m), 0);
}

static void what_does_not_fit_the_bytes_goes_and_is_counted_for_its_topic(void **state)
{
    struct box *b = *state;
    uint64_t dropped;
    size_t queued;
    receive_queue_keep_all(b->m, 100);
    put_bytes(b, b->all, 1, 60);
    put_bytes(b, b->latest, 2, 50); /* 110 */
    put_bytes(b, b->all, 3, 40);
    put_bytes(b, b->all, 4, 1);
    receive_queue_count(b->m, b->latest, &dropped, &queued);
    assert_int_equal(dropped, 1);
    receive_queue_count(b->m, b->all, &dropped, &queued);
    assert_int_equal(dropped, 1);
    assert_int_equal(queued, 2);
    assert_int_equal(take(b), 1);
    put_bytes(b, b->latest, 5, 60);
    assert_int_equal(take(b), 3);
    assert_int_equal(take(b), 5);
    put_bytes(b, b->latest, 6, 5000); /* by itself */
    assert_int_equal(take(b), 6);
}

int main(void)
{
#define in_a_box(test) cmocka_unit_test_setup_teardown(test, open_box, close_box)
    const struct CMUnitTest tests[] = {
        in_a_box(messages_of_all_topics_come_in_the_order_of_arrival),
        in_a_box(a_full_queue_drops_its_oldest_and_counts_it),
        in_a_box(a_newer_state_replaces_the_one_that_waits),
        in_a_box(what_is_replayed_all_waits),
        in_a_box(a_flood_of_one_topic_costs_the_others_nothing),
        in_a_box(a_flood_does_not_hide_a_state_that_is_told_often),
        in_a_box(the_descriptor_is_readable_while_messages_wait),
        in_a_box(an_empty_box_times_out),
        in_a_box(an_interrupt_comes_before_messages_that_wait),
        in_a_box(an_interrupt_makes_an_empty_box_readable),
        in_a_box(an_interrupt_can_be_ended),
        in_a_box(who_must_have_everything_gets_it_whatever_depth_and_policy),
        in_a_box(what_does_not_fit_the_bytes_goes_and_is_counted_for_its_topic),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
