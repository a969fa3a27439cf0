/* SPDX-License-Identifier: MIT */
/* What waits for a slow client, and what waits to be converted. */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "nodes/foxglove/queue.h"

static int push(struct queue *q, size_t channel, size_t size, int64_t t_ns)
{
    static uint8_t data[1000];
    const struct outgoing o = {.kind = OUTGOING_MESSAGE,
                               .blob = blob_copy(data, size),
                               .channel = channel,
                               .t_ns = t_ns};

    assert_non_null(o.blob);
    return queue_push(q, &o);
}

static int push_text(struct queue *q)
{
    const struct outgoing o = {.kind = OUTGOING_TEXT, .blob = blob_copy("x", 1)};

    return queue_push(q, &o);
}

/* The oldest is the one of this time. */
static void assert_next(struct queue *q, int64_t t_ns)
{
    struct outgoing o;

    assert_true(queue_pop(q, &o));
    assert_int_equal(o.t_ns, t_ns);
    blob_release(o.blob);
}

static void messages_come_out_in_their_order(void **state)
{
    struct queue q = {.max_bytes = 1000, .max_messages = 10};
    struct outgoing o;

    (void)state;
    for (int i = 0; i < 3; i++)
        assert_int_equal(push(&q, (size_t)i, 10, i), 0);
    assert_int_equal(q.bytes, 30);
    for (int i = 0; i < 3; i++)
        assert_next(&q, i);
    assert_false(queue_pop(&q, &o));
    assert_int_equal(q.bytes + q.messages, 0);
    assert_int_equal(push(&q, 0, 10, 7), 0); /* an emptied one goes on */
    assert_next(&q, 7);
}

static void of_a_full_queue_the_oldest_of_the_channel_goes(void **state)
{
    struct queue q = {.max_bytes = 1000, .max_messages = 3};

    (void)state;
    push(&q, 1, 10, 0);
    push(&q, 2, 10, 1);
    push(&q, 2, 10, 2);
    assert_int_equal(push(&q, 2, 10, 3), 1);
    assert_next(&q, 0);
    assert_next(&q, 2);
    assert_next(&q, 3);
}

static void then_the_oldest_of_any_goes(void **state)
{
    struct queue q = {.max_bytes = 100, .max_messages = 10};

    (void)state;
    push(&q, 1, 40, 0);
    push(&q, 2, 40, 1);
    assert_int_equal(push(&q, 3, 50, 2), 1);
    assert_int_equal(push(&q, 3, 90, 3), 2);
    assert_next(&q, 3);
    assert_null(q.first);
}

static void a_message_larger_than_the_queue_waits_alone(void **state)
{
    struct queue q = {.max_bytes = 100, .max_messages = 10};

    (void)state;
    push(&q, 1, 40, 0);
    assert_int_equal(push(&q, 2, 500, 1), 1);
    assert_int_equal(q.messages, 1);
    assert_int_equal(push(&q, 1, 1, 2), 1);
    assert_next(&q, 2);
}

static void texts_are_bounded_and_never_push_messages_out(void **state)
{
    struct queue q = {.max_bytes = 100, .max_messages = 2};
    struct outgoing o;
    int n = 0;

    (void)state;
    push(&q, 1, 50, 0);
    for (int i = 0; i < 3 * QUEUE_MAX_TEXTS; i++)
        n += push_text(&q);
    assert_int_equal(n, 2 * QUEUE_MAX_TEXTS);
    assert_int_equal(q.messages, 1);
    assert_int_equal(push(&q, 1, 60, 1), 1);
    for (n = 0; queue_pop(&q, &o); n++)
        blob_release(o.blob);
    assert_int_equal(n, QUEUE_MAX_TEXTS + 1);
}

static void what_is_unsubscribed_is_not_sent_any_more(void **state)
{
    struct queue q = {.max_bytes = 1000, .max_messages = 10};

    (void)state;
    for (int i = 0; i < 6; i++)
        push(&q, i % 2, 10, i);
    queue_forget(&q, 1);
    assert_int_equal(q.messages, 3);
    assert_int_equal(q.bytes, 30);
    assert_int_equal(push(&q, 1, 10, 6), 0); /* behind the last */
    assert_next(&q, 0);
    assert_next(&q, 2);
    assert_next(&q, 4);
    assert_next(&q, 6);
    push(&q, 1, 10, 7);
    queue_clear(&q);
    assert_int_equal(q.messages + q.bytes, 0);
}

static int arrive(struct inbox *b, const struct topic *t, int64_t t_ns, uint64_t client,
                  size_t channel)
{
    const struct arrival a = {.topic = t,
                              .publish_ns = t_ns,
                              .payload = blob_copy("x", 1),
                              .client = client,
                              .channel = channel};

    return inbox_push(b, &a);
}

static void assert_arrival(struct inbox *b, int64_t t_ns)
{
    struct arrival a;

    assert_true(inbox_pop(b, &a));
    assert_int_equal(a.publish_ns, t_ns);
    blob_release(a.payload);
}

static void of_state_only_the_newest_waits(void **state)
{
    struct inbox b = {NULL};

    (void)state;
    assert_int_equal(arrive(&b, topic_volume(), 0, 0, 0), 0);
    assert_int_equal(arrive(&b, topic_survey(), 1, 0, 0), 0);
    assert_int_equal(arrive(&b, topic_volume(), 2, 0, 0), 1);
    assert_arrival(&b, 1);
    assert_arrival(&b, 2);
    assert_null(b.first);
}

static void events_wait_up_to_their_topics_depth(void **state)
{
    struct inbox b = {NULL};
    int64_t depth = (int64_t)topic_ping()->depth;
    int skipped = 0;

    (void)state;
    for (int64_t i = 0; i < depth + 5; i++)
        skipped += arrive(&b, topic_ping(), i, 0, 0);
    assert_int_equal(skipped, 5);
    assert_arrival(&b, 5);
    inbox_clear(&b);
    assert_null(b.first);
}

/* A client that subscribes again and again makes no more work than once. */
static void a_late_client_waits_once_for_each_channel(void **state)
{
    struct inbox b = {NULL};

    (void)state;
    arrive(&b, topic_volume(), 0, 0, 0);
    for (int i = 1; i < 100; i++)
        arrive(&b, topic_volume(), i, 1, 20);
    arrive(&b, topic_volume(), 100, 1, 21);
    arrive(&b, topic_volume(), 101, 2, 20);
    assert_arrival(&b, 0);
    assert_arrival(&b, 99);
    assert_arrival(&b, 100);
    assert_arrival(&b, 101);
    assert_null(b.first);
}

static void a_blob_lives_as_long_as_its_last_owner(void **state)
{
    struct blob *b = blob_copy("abc", 3);

    (void)state;
    assert_ptr_equal(blob_hold(b), b);
    blob_release(b);
    assert_memory_equal(b->data, "abc", 3);
    blob_release(b);
    blob_release(NULL);
    assert_null(blob_create(NULL, 0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(messages_come_out_in_their_order),
        cmocka_unit_test(of_a_full_queue_the_oldest_of_the_channel_goes),
        cmocka_unit_test(then_the_oldest_of_any_goes),
        cmocka_unit_test(a_message_larger_than_the_queue_waits_alone),
        cmocka_unit_test(texts_are_bounded_and_never_push_messages_out),
        cmocka_unit_test(what_is_unsubscribed_is_not_sent_any_more),
        cmocka_unit_test(of_state_only_the_newest_waits),
        cmocka_unit_test(events_wait_up_to_their_topics_depth),
        cmocka_unit_test(a_late_client_waits_once_for_each_channel),
        cmocka_unit_test(a_blob_lives_as_long_as_its_last_owner),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
