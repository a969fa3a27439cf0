#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/topics.h"
#include "nodes/rt/replay_order.h"

#define MS 1000000LL

struct rig {
    struct replay_order order;
    int64_t now_ns, due_ns;
    char text[4000]; /* what came out: "e20 p30 " */
};

static char letter(const struct topic *t)
{
    return t == topic_ego() ? 'e' : t == topic_wall() ? 'w' : 'p';
}

static void put(struct rig *r, const struct topic *t, int64_t stamp_ms)
{
    struct bus_message m = {.topic = t,
                            .envelope = {.publish_ns = stamp_ms * MS, .replayed = true}};

    assert_true(replay_order_takes(&m));
    replay_order_put(&r->order, &m, r->now_ns);
}

/* All whose turn it is. */
static const char *take(struct rig *r)
{
    struct bus_message m;

    r->text[0] = '\0';
    while (replay_order_take(&r->order, &m, r->now_ns, &r->due_ns)) {
        size_t used = strlen(r->text);
        snprintf(r->text + used, sizeof r->text - used, "%c%d ", letter(m.topic),
                 (int)(m.envelope.publish_ns / MS));
    }
    return r->text;
}

static int setup(void **state)
{
    *state = calloc(1, sizeof(struct rig));
    return *state ? 0 : -1;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    replay_order_clear(&r->order);
    free(r);
    return 0;
}

static void sound_comes_at_once_where_nobody_tells_of_motion(void **state)
{
    struct rig *r = *state;

    put(r, topic_ping(), 10);
    assert_string_equal(take(r), "p10 ");
    put(r, topic_ping(), 20);
    assert_string_equal(take(r), "p20 ");
    assert_true(r->due_ns == INT64_MAX);
}

static void whoever_comes_first_the_stamps_decide(void **state)
{
    struct rig *r = *state;

    put(r, topic_ego(), 20);
    put(r, topic_ping(), 10);
    assert_string_equal(take(r), "p10 ");
    put(r, topic_ping(), 30);
    put(r, topic_ping(), 50);
    assert_string_equal(take(r), "e20 ");
    put(r, topic_wall(), 35);
    put(r, topic_ego(), 40);
    assert_string_equal(take(r), "p30 w35 e40 ");
    put(r, topic_ego(), 60);
    assert_string_equal(take(r), "");
    put(r, topic_wall(), 45);
    assert_string_equal(take(r), "w45 ");
    put(r, topic_wall(), 55);
    assert_string_equal(take(r), "p50 ");
}

static void walls_that_are_not_told_any_more_are_not_waited_for(void **state)
{
    struct rig *r = *state;

    put(r, topic_wall(), 10);
    put(r, topic_ping(), 100);
    assert_string_equal(take(r), "w10 ");
    put(r, topic_ego(), 400);
    assert_string_equal(take(r), "");
    put(r, topic_ego(), 401);
    assert_string_equal(take(r), "p100 ");
    put(r, topic_ping(), 390);
    assert_string_equal(take(r), "p390 ");
}

static void what_waits_for_motion_that_does_not_come_goes_on_after_a_while(void **state)
{
    struct rig *r = *state;

    put(r, topic_ego(), 20);
    put(r, topic_ping(), 30);
    assert_string_equal(take(r), "e20 ");
    assert_int_equal(r->due_ns, 300 * MS);
    r->now_ns = 299 * MS;
    assert_string_equal(take(r), "");
    r->now_ns = 300 * MS;
    assert_string_equal(take(r), "p30 ");
    put(r, topic_ego(), 40);
    assert_string_equal(take(r), "");
    r->now_ns = 600 * MS;
    assert_string_equal(take(r), "e40 ");
}

static void who_is_at_work_does_not_wait(void **state)
{
    struct rig *r = *state;

    put(r, topic_ego(), 20);
    put(r, topic_ping(), 30);
    assert_string_equal(take(r), "e20 ");
    r->now_ns = 10 * MS;
    replay_order_leave(&r->order, r->now_ns);
    r->now_ns = 1010 * MS;
    replay_order_return(&r->order, r->now_ns);
    assert_string_equal(take(r), "");
    r->now_ns = 1300 * MS;
    assert_string_equal(take(r), "p30 ");
}

static void nothing_is_lost_when_much_waits(void **state)
{
    struct rig *r = *state;
    struct bus_message m;
    size_t n = 0;

    for (int i = 0; i < 1000; i++) {
        put(r, topic_ego(), 20 * i);
        while (replay_order_take(&r->order, &m, r->now_ns, &r->due_ns))
            assert_int_equal(m.envelope.publish_ns, 20 * MS * (int64_t)n++);
    }
    r->now_ns += 1000 * MS;
    while (replay_order_take(&r->order, &m, r->now_ns, &r->due_ns))
        n++;
    assert_int_equal(n, 1000);
}

static void live_messages_and_those_of_other_kinds_do_not_wait(void **state)
{
    struct bus_message m = {.topic = topic_ping()};

    (void)state;
    assert_false(replay_order_takes(&m));
    m = (struct bus_message){.topic = topic_survey(), .envelope = {.replayed = true}};
    assert_false(replay_order_takes(&m));
    m.topic = topic_scan_status();
    assert_false(replay_order_takes(&m));
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(sound_comes_at_once_where_nobody_tells_of_motion),
        TEST(whoever_comes_first_the_stamps_decide),
        TEST(walls_that_are_not_told_any_more_are_not_waited_for),
        TEST(what_waits_for_motion_that_does_not_come_goes_on_after_a_while),
        TEST(who_is_at_work_does_not_wait),
        TEST(nothing_is_lost_when_much_waits),
        TEST(live_messages_and_those_of_other_kinds_do_not_wait),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
