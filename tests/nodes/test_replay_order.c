/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "msgs/topics.h"
#include "nodes/rt/replay_order.h"

struct rig { /* the node recon, which hears play, dsp and wall */
    struct replay_order order;
    uint64_t pings, motions, walls; /* sent, of traces, ego and wall */
    int64_t epoch_ns;               /* of all of them */
    bool without_wall;              /* play does not wait for it any more */
    char text[4000];                /* what came out: "e20 t30 " */
};

static char letter(const struct topic *t)
{
    return t == topic_ego() ? 'e' : t == topic_wall() ? 'w' : 't';
}

static void put(struct rig *r, const struct topic *t, int64_t stamp_ns)
{
    struct bus_message m = {
        .topic = t,
        .envelope = {.publish_ns = stamp_ns, .epoch_ns = r->epoch_ns, .replayed = true}};
    uint64_t *n = t == topic_ego()    ? &r->motions
                  : t == topic_wall() ? &r->walls
                                      : &r->pings;

    m.envelope.sequence = (*n)++;
    snprintf(m.envelope.node, sizeof m.envelope.node, "%s",
             t == topic_ego()    ? "vehicle"
             : t == topic_wall() ? "wall"
                                 : "dsp");
    assert_true(replay_order_has(t));
    assert_int_equal(replay_order_put(&r->order, &m), 0);
}

/* That all up to the stamp was used, and so many messages were sent of the topic. */
static void tell(struct rig *r, uint64_t round, const char *from, int64_t time_ns,
                 const struct topic *t, uint64_t sent_n)
{
    static char *nodes[] = {(char *)"dsp", (char *)"recon", (char *)"track",
                            (char *)"can", (char *)"wall"};
    Anlos__Progress p = ANLOS__PROGRESS__INIT;
    Anlos__Sent sent = ANLOS__SENT__INIT, *list[] = {&sent};

    p.round = round;
    p.time_ns = time_ns;
    sent.node = (char *)(t == topic_ego() ? "vehicle" : from);
    sent.topic = (char *)t->name;
    sent.next = sent_n;
    p.sent = list;
    p.n_sent = 1;
    p.nodes = nodes;
    p.n_nodes = strcmp(from, "play") ? 0 : r->without_wall ? 4 : 5;
    replay_order_progress(&r->order, "recon", from, r->epoch_ns, &p);
}

/* All three, who have sent what has come here. */
static void tell_all(struct rig *r, uint64_t round, int64_t time_ns)
{
    tell(r, round, "play", time_ns, topic_ego(), r->motions);
    tell(r, round, "dsp", time_ns, topic_traces(), r->pings);
    tell(r, round, "wall", time_ns, topic_wall(), r->walls);
}

/* All whose turn it is. */
static const char *take(struct rig *r)
{
    struct bus_message m;

    r->text[0] = '\0';
    while (replay_order_take(&r->order, &m)) {
        size_t used = strlen(r->text);
        snprintf(r->text + used, sizeof r->text - used, "%c%d ", letter(m.topic),
                 (int)m.envelope.publish_ns);
    }
    return r->text;
}

static int setup(void **state)
{
    struct rig *r = calloc(1, sizeof *r);

    *state = r;
    if (!r)
        return -1;
    replay_order_expect(&r->order, topic_survey());
    replay_order_expect(&r->order, topic_traces());
    replay_order_expect(&r->order, topic_ego());
    replay_order_expect(&r->order, topic_wall());
    replay_order_expect(&r->order, topic_health()); /* which has no order */
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    replay_order_clear(&r->order);
    free(r);
    return 0;
}

static void without_anybody_s_progress_messages_go_as_they_come(void **state)
{
    struct rig *r = *state;
    int64_t time_ns;

    put(r, topic_traces(), 20);
    put(r, topic_ego(), 10);
    assert_string_equal(take(r), "t20 e10 ");
    assert_false(replay_order_done(&r->order, &time_ns));
}

static void whoever_comes_first_the_stamps_decide(void **state)
{
    struct rig *r = *state;

    tell_all(r, 1, 0);
    put(r, topic_wall(), 20);
    put(r, topic_traces(), 20);
    put(r, topic_ego(), 15);
    put(r, topic_ego(), 25);
    put(r, topic_traces(), 10);
    assert_string_equal(take(r), "");
    tell_all(r, 1, 22);
    assert_string_equal(take(r), "t10 e15 t20 w20 ");
    tell_all(r, 1, 25);
    assert_string_equal(take(r), "e25 ");
}

static void a_message_waits_for_all_who_may_send_an_earlier_one(void **state)
{
    struct rig *r = *state;

    tell_all(r, 1, 0);
    put(r, topic_traces(), 10);
    tell(r, 1, "dsp", 50, topic_traces(), 1);
    tell(r, 1, "play", 50, topic_ego(), 0);
    tell(r, 1, "wall", 9, topic_wall(), 0);
    assert_string_equal(take(r), "");
    tell(r, 1, "wall", 10, topic_wall(), 0);
    assert_string_equal(take(r), "t10 ");
}

static void what_was_sent_before_and_is_still_on_its_way_is_waited_for(void **state)
{
    struct rig *r = *state;

    tell_all(r, 1, 0);
    put(r, topic_traces(), 20);
    tell(r, 1, "dsp", 20, topic_traces(), 1);
    tell(r, 1, "wall", 20, topic_wall(), 1);
    tell(r, 1, "play", 20, topic_ego(), 2);
    put(r, topic_ego(), 11);
    assert_string_equal(take(r), "");
    put(r, topic_wall(), 12);
    assert_string_equal(take(r), "");
    put(r, topic_ego(), 13);
    assert_string_equal(take(r), "e11 w12 e13 t20 ");
}

static void what_was_sent_before_this_node_listened_is_not_waited_for(void **state)
{
    struct rig *r = *state;

    tell(r, 1, "play", 0, topic_ego(), 77);
    tell(r, 1, "dsp", 0, topic_traces(), 5);
    tell(r, 1, "wall", 0, topic_wall(), 9);
    r->motions = 77;
    put(r, topic_ego(), 10);
    tell(r, 1, "play", 10, topic_ego(), 78);
    tell(r, 1, "dsp", 10, topic_traces(), 5);
    tell(r, 1, "wall", 10, topic_wall(), 9);
    assert_string_equal(take(r), "e10 ");
}

static void who_comes_later_in_the_chain_is_not_waited_for(void **state)
{
    struct rig *r = *state;
    int64_t time_ns = 0;

    tell_all(r, 1, 7); /* track and can say nothing */
    assert_true(replay_order_done(&r->order, &time_ns));
    assert_int_equal(time_ns, 7);
}

static void what_is_used_is_told_once_and_not_before_all_have_spoken(void **state)
{
    struct rig *r = *state;
    int64_t time_ns = 0;

    tell(r, 1, "play", 5, topic_ego(), 0);
    assert_false(replay_order_done(&r->order, &time_ns));
    tell(r, 1, "dsp", 4, topic_traces(), 0);
    tell(r, 1, "wall", 6, topic_wall(), 0);
    assert_true(replay_order_done(&r->order, &time_ns));
    assert_int_equal(time_ns, 4);
    assert_false(replay_order_done(&r->order, &time_ns));
    tell(r, 1, "dsp", 9, topic_traces(), 0);
    assert_true(replay_order_done(&r->order, &time_ns));
    assert_int_equal(time_ns, 5);
    tell(r, 1, "dsp", 9, topic_traces(), 0);
    assert_false(replay_order_done(&r->order, &time_ns));
    tell(r, 1, "play", 5, topic_ego(), 0); /* for who came later */
    assert_true(replay_order_done(&r->order, &time_ns));
    assert_int_equal(time_ns, 5);
    assert_false(replay_order_done(&r->order, &time_ns));
}

/* Play has jumped back: what others said of the round before counts no more. */
static void another_round_begins_when_all_speak_of_it(void **state)
{
    struct rig *r = *state;
    int64_t time_ns = 0;

    tell_all(r, 1, 100);
    assert_true(replay_order_done(&r->order, &time_ns));
    tell(r, 2, "dsp", 0, topic_traces(), 0);
    tell(r, 1, "play", 110, topic_ego(), 0);
    assert_string_equal(take(r), "");
    tell_all(r, 2, 0);
    assert_true(replay_order_done(&r->order, &time_ns));
    assert_int_equal(time_ns, 0);
    put(r, topic_ego(), 10);
    assert_string_equal(take(r), "");
    tell_all(r, 2, 10);
    assert_string_equal(take(r), "e10 ");
}

/* Its rounds begin with when it began, its stamps and sequences anew. */
static void another_play_is_another_round_though_it_is_earlier(void **state)
{
    struct rig *r = *state;
    int64_t time_ns = 0;

    for (int i = 0; i < 100; i++)
        put(r, topic_ego(), 100);
    tell_all(r, 1000, 100);
    take(r);
    assert_true(replay_order_done(&r->order, &time_ns));
    r->motions = r->pings = r->walls = 0;
    r->epoch_ns = 2000;
    tell(r, 2000, "play", 0, topic_ego(), 0);
    tell(r, 2000, "play", 0, topic_ego(), 0);
    assert_false(replay_order_done(&r->order, &time_ns)); /* not 100 again */
    tell(r, 2000, "dsp", 0, topic_traces(), 0);
    tell(r, 2000, "wall", 0, topic_wall(), 0);
    assert_true(replay_order_done(&r->order, &time_ns));
    assert_int_equal(time_ns, 0);
    tell(r, 2000, "play", 10, topic_ego(), 1); /* which has not come yet */
    tell(r, 2000, "dsp", 10, topic_traces(), 0);
    tell(r, 2000, "wall", 10, topic_wall(), 0);
    assert_false(replay_order_done(&r->order, &time_ns));
    put(r, topic_ego(), 10);
    assert_string_equal(take(r), "e10 ");
    assert_true(replay_order_done(&r->order, &time_ns));
    assert_int_equal(time_ns, 10);
}

/* What waits of the round before, and what of it is still on its way when the next one
 * begins, is not given out beside the same that is played again. */
static void after_a_jump_no_message_is_given_out_twice(void **state)
{
    struct rig *r = *state;
    int64_t time_ns = 0;

    tell_all(r, 1, 0);
    put(r, topic_ego(), 10);
    put(r, topic_ego(), 20);
    put(r, topic_traces(), 20);
    tell_all(r, 1, 10);
    assert_string_equal(take(r), "e10 ");
    assert_true(replay_order_done(&r->order, &time_ns));

    /* Play jumps back, having sent the motion of 30; dsp has sent the traces of 30. */
    tell(r, 2, "play", 0, topic_ego(), 3);
    put(r, topic_ego(), 30);
    tell(r, 2, "dsp", 0, topic_traces(), 2);
    assert_string_equal(take(r), "");
    assert_false(replay_order_done(&r->order, &time_ns));
    tell(r, 2, "wall", 0, topic_wall(), 0);
    assert_string_equal(take(r), "");
    assert_true(replay_order_done(&r->order, &time_ns)); /* before anything is taken */
    assert_int_equal(time_ns, 0);
    put(r, topic_traces(), 30);

    for (int stamp = 10; stamp <= 30; stamp += 10)
        put(r, topic_ego(), stamp);
    put(r, topic_traces(), 20);
    put(r, topic_traces(), 30);
    tell(r, 2, "play", 30, topic_ego(), 6);
    tell(r, 2, "dsp", 30, topic_traces(), 4);
    tell(r, 2, "wall", 30, topic_wall(), 0);
    assert_string_equal(take(r), "e10 e20 t20 e30 t30 ");
}

/* Forwards, what was not used before the jump is not used after it. */
static void after_a_jump_forwards_nothing_comes_of_what_was_passed_over(void **state)
{
    struct rig *r = *state;

    tell_all(r, 1, 0);
    put(r, topic_ego(), 20);
    put(r, topic_traces(), 20);
    tell_all(r, 2, 99);
    assert_string_equal(take(r), "");
    put(r, topic_ego(), 100);
    tell_all(r, 2, 100);
    assert_string_equal(take(r), "e100 ");
}

/* Another play counts anew: what the one before it sent is told by its epoch. */
static void what_an_earlier_play_sent_is_nothing_of_the_next(void **state)
{
    struct rig *r = *state;

    tell_all(r, 1, 0);
    put(r, topic_ego(), 10);
    r->epoch_ns = 2000;
    r->motions = r->pings = r->walls = 0;
    put(r, topic_ego(), 9); /* before it says so */
    tell_all(r, 2000, 0);
    put(r, topic_ego(), 10);
    tell_all(r, 2000, 10);
    assert_string_equal(take(r), "e9 e10 ");
}

static void who_is_waited_for_no_more_holds_nobody_up(void **state)
{
    struct rig *r = *state;

    tell_all(r, 1, 0);
    put(r, topic_ego(), 10);
    tell(r, 1, "play", 10, topic_ego(), 1);
    tell(r, 1, "dsp", 10, topic_traces(), 0);
    assert_string_equal(take(r), "");
    r->without_wall = true;
    tell(r, 1, "play", 10, topic_ego(), 1);
    assert_string_equal(take(r), "e10 ");
}

static void more_than_there_is_room_for_waits_all_the_same(void **state)
{
    struct rig *r = *state;
    struct bus_message m;
    int n = 0;

    tell_all(r, 1, 0);
    for (int i = 1000; i > 0; i--)
        put(r, topic_traces(), i);
    tell_all(r, 1, 1000);
    while (replay_order_take(&r->order, &m))
        assert_int_equal(m.envelope.publish_ns, ++n);
    assert_int_equal(n, 1000);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(without_anybody_s_progress_messages_go_as_they_come),
        TEST(whoever_comes_first_the_stamps_decide),
        TEST(a_message_waits_for_all_who_may_send_an_earlier_one),
        TEST(what_was_sent_before_and_is_still_on_its_way_is_waited_for),
        TEST(what_was_sent_before_this_node_listened_is_not_waited_for),
        TEST(who_comes_later_in_the_chain_is_not_waited_for),
        TEST(what_is_used_is_told_once_and_not_before_all_have_spoken),
        TEST(another_round_begins_when_all_speak_of_it),
        TEST(another_play_is_another_round_though_it_is_earlier),
        TEST(after_a_jump_no_message_is_given_out_twice),
        TEST(after_a_jump_forwards_nothing_comes_of_what_was_passed_over),
        TEST(what_an_earlier_play_sent_is_nothing_of_the_next),
        TEST(who_is_waited_for_no_more_holds_nobody_up),
        TEST(more_than_there_is_room_for_waits_all_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
