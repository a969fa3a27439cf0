/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/play/subscribers.h"

struct said { /* a health message and what it points to */
    Anlos__Health message;
    Anlos__TopicCount count;
    Anlos__TopicCount *list[1];
};

static const Anlos__Health *say(struct said *s, Anlos__Health__State state,
                                const char *topic, uint32_t peers)
{
    anlos__health__init(&s->message);
    anlos__topic_count__init(&s->count);
    s->count.topic = (char *)topic;
    s->count.peers = peers;
    s->list[0] = &s->count;
    s->message.state = state;
    s->message.n_topics = 1;
    s->message.topics = s->list;
    return &s->message;
}

static bool everybody_speaks(const void *ctx, const char *node, const struct topic *t)
{
    (void)ctx;
    (void)node;
    (void)t;
    return true;
}

static void everybody_is_waited_for_by_name(void **state)
{
    struct subscribers a;
    struct said s;
    char text[100];

    (void)state;
    subscribers_init(&a, everybody_speaks, NULL);
    assert_true(subscribers_is_ready(&a, text, sizeof text));
    subscribers_expect(&a, "dsp");
    subscribers_expect(&a, "recon");
    subscribers_expect(&a, "dsp");
    assert_int_equal(a.n, 2);
    assert_false(subscribers_is_ready(&a, text, sizeof text));
    assert_string_equal(text, "waits for dsp, recon");
    subscribers_health(&a, "dsp", 5, say(&s, ANLOS__HEALTH__STATE__READY, "ping", 1), 10);
    assert_false(subscribers_is_ready(&a, text, sizeof text));
    assert_string_equal(text, "waits for recon");
    subscribers_health(&a, "recon", 5,
                       say(&s, ANLOS__HEALTH__STATE__DEGRADED, "traces", 1), 10);
    assert_true(subscribers_is_ready(&a, text, sizeof text));
}

static void who_is_not_connected_is_not_ready(void **state)
{
    struct subscribers a;
    struct said s;
    char text[100];

    (void)state;
    subscribers_init(&a, everybody_speaks, NULL);
    subscribers_expect(&a, "can");
    /* two nodes send receipts */
    subscribers_health(&a, "can", 5, say(&s, ANLOS__HEALTH__STATE__READY, "receipt", 1),
                       10);
    assert_false(subscribers_is_ready(&a, text, sizeof text));
    subscribers_health(&a, "can", 5, say(&s, ANLOS__HEALTH__STATE__READY, "receipt", 2),
                       10);
    assert_true(subscribers_is_ready(&a, text, sizeof text));
    /* everybody sends health: whoever is not there cannot be connected */
    subscribers_health(&a, "can", 5, say(&s, ANLOS__HEALTH__STATE__READY, "health", 0),
                       10);
    assert_true(subscribers_is_ready(&a, text, sizeof text));
}

static void a_new_process_under_the_name_is_noticed_once(void **state)
{
    struct subscribers a;
    struct said s;
    const Anlos__Health *h = say(&s, ANLOS__HEALTH__STATE__READY, "ping", 1);

    (void)state;
    subscribers_init(&a, everybody_speaks, NULL);
    subscribers_expect(&a, "dsp");
    assert_false(subscribers_health(&a, "dsp", 5, h, 10));
    assert_false(subscribers_health(&a, "dsp", 5, h, 20));
    assert_true(subscribers_health(&a, "dsp", 6, h, 30));
    assert_false(subscribers_health(&a, "dsp", 6, h, 40));
    assert_false(subscribers_health(&a, "dsp", 5, h, 50)); /* of the dead one */
    assert_false(subscribers_heard(&a, "dsp", 40));
    assert_true(subscribers_heard(&a, "dsp", 39));
    assert_true(subscribers_heard(&a, "stranger", 1000));
    assert_false(subscribers_health(&a, "stranger", 7, h, 60));
    assert_false(subscribers_has(&a, "stranger"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(everybody_is_waited_for_by_name),
        cmocka_unit_test(who_is_not_connected_is_not_ready),
        cmocka_unit_test(a_new_process_under_the_name_is_noticed_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
