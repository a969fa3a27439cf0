/* SPDX-License-Identifier: MIT */
/* A node in this process hears what somebody plays: one of a replay has the time of the
 * sound, a live one hears nothing. */
#include "tests/hal/scratch.h"

#include <errno.h>

#include "msgs/array.pb-c.h"
#include "msgs/playback_publisher.h"
#include "msgs/survey.pb-c.h"
#include "nodes/rt/node.h"

#define DEADLINE_MS 60000

struct rig {
    struct scratch *scratch;
    struct node *node;
    struct playback_publisher *playback_publisher;
};

static int set_up(void **state, const char *option)
{
    struct rig *r = calloc(1, sizeof *r);
    char launch[600];

    if (!r || scratch_open((void **)&r->scratch))
        return -1;
    snprintf(launch, sizeof launch, "%s",
             scratch_write(r->scratch, "a.yaml", "nodes: [dsp]\n"));
    char *argv[] = {(char *)"program",  (char *)"--launch", launch, (char *)"--run-dir",
                    r->scratch->folder, (char *)option,     NULL};
    if (node_create(&r->node, "dsp", "Does nothing.", option ? 6 : 5, argv) ||
        node_subscribe(r->node, topic_ping()) || node_subscribe(r->node, topic_survey()))
        return -1;
    if (playback_publisher_create(&r->playback_publisher, r->scratch->folder, 5, NULL) ||
        playback_publisher_add(r->playback_publisher, "array", topic_ping(), NULL) ||
        playback_publisher_add(r->playback_publisher, "array", topic_survey(), NULL))
        return -1;
    *state = r;
    return 0;
}

static int setup(void **state)
{
    return set_up(state, "--replay");
}

static int setup_live(void **state)
{
    return set_up(state, NULL);
}

static int teardown(void **state)
{
    struct rig *r = *state;
    void *scratch = r->scratch;

    playback_publisher_destroy(r->playback_publisher);
    node_finish(r->node, 0);
    free(r);
    return scratch_close(&scratch);
}

/* Until it arrives: the first ones may be lost while the connection is made. */
static void play(struct rig *r, const struct topic *t, int64_t capture_ns,
                 int64_t publish_ns)
{
    struct node_message in;
    int err = -ETIMEDOUT;

    for (int i = 0; err == -ETIMEDOUT; i++) {
        assert_true(i < DEADLINE_MS / 20);
        assert_int_equal(playback_publisher_publish(r->playback_publisher, "array", t,
                                                    capture_ns, publish_ns, "", 0),
                         0);
        err = node_next(r->node, &in, 20);
    }
    assert_int_equal(err, 0);
    while (!node_next(r->node, &in, 0)) /* what came twice */
        ;
}

static void the_time_is_that_of_the_newest_sound(void **state)
{
    struct rig *r = *state;
    int64_t machine_ns = node_machine_ns(r->node);

    assert_true(node_is_replayed(r->node));
    assert_false(node_follows_replay(r->node));
    assert_true(node_now_ns(r->node) >= machine_ns);
    play(r, topic_survey(), 0, 500);
    assert_true(node_follows_replay(r->node));
    assert_int_equal(node_now_ns(r->node), 500);
    play(r, topic_ping(), 890, 900);
    assert_int_equal(node_now_ns(r->node), 900);
    /* What is no sound comes as it likes, and moves nothing. */
    play(r, topic_survey(), 0, 950);
    assert_int_equal(node_now_ns(r->node), 900);
    play(r, topic_ping(), 790, 800); /* a bag that begins again */
    assert_int_equal(node_now_ns(r->node), 800);
    assert_true(node_machine_ns(r->node) > machine_ns);
}

static struct bus_message receive(struct rig *r, struct bus *b, const struct topic *t)
{
    struct bus_message m = {0};
    struct node_message in;
    Anlos__Health h = ANLOS__HEALTH__INIT;
    int err = -ETIMEDOUT;

    for (int i = 0; err; i++) {
        assert_true(i < DEADLINE_MS / 10);
        assert_int_equal(node_publish(r->node, t, 0, &h.base), 0);
        err = bus_receive(b, &m, 10);
        node_next(r->node, &in, 0);
    }
    return m;
}

static void what_a_node_makes_of_a_replay_is_marked_and_stamped_so(void **state)
{
    struct rig *r = *state;
    const struct bus_config cfg = {.run_dir = r->scratch->folder, .listen_only = true};
    struct bus *b = NULL;

    play(r, topic_ping(), 890, 900);
    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_health()), 0);
    struct bus_message m = receive(r, b, topic_health());
    assert_true(m.envelope.replayed);
    assert_int_equal(m.envelope.publish_ns, 900);
    bus_message_free(&m);
    bus_destroy(b);
}

/* Somebody publishes until the node has refused it, and says so in its health. */
static void assert_refused(struct rig *r, int (*publish)(void *from), void *from)
{
    const struct bus_config cfg = {.run_dir = r->scratch->folder, .listen_only = true};
    struct node_message in;
    struct bus_message m;
    struct bus *b = NULL;
    uint64_t refused = 0;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, topic_health()), 0);
    for (int i = 0; !refused; i++) {
        assert_true(i < DEADLINE_MS / 20);
        assert_int_equal(publish(from), 0);
        assert_int_equal(node_next(r->node, &in, 20), -ETIMEDOUT);
        while (!bus_receive(b, &m, 0)) {
            Anlos__Health *h = (Anlos__Health *)bus_message_unpack(&m);
            assert_non_null(h);
            refused = h->refused;
            anlos__health__free_unpacked(h, NULL);
            bus_message_free(&m);
        }
    }
    bus_destroy(b);
}

static int publish_replayed(void *from)
{
    return playback_publisher_publish(from, "array", topic_ping(), 890, 900, "", 0);
}

static void a_live_node_refuses_what_is_replayed_and_its_time(void **state)
{
    struct rig *r = *state;
    int64_t machine_ns = node_machine_ns(r->node);

    assert_refused(r, publish_replayed, r->playback_publisher);
    assert_false(node_is_replayed(r->node));
    assert_false(node_follows_replay(r->node));
    assert_true(node_now_ns(r->node) >= machine_ns);
}

static int publish_live(void *from)
{
    return bus_publish(from, topic_ping(), 1, 2, "", 0);
}

static void live_sound_does_not_end_a_replay(void **state)
{
    struct rig *r = *state;
    struct bus *array = NULL;

    play(r, topic_ping(), 890, 900);
    playback_publisher_destroy(r->playback_publisher);
    r->playback_publisher = NULL;
    const struct bus_config cfg = {
        .node = "array", .run_dir = r->scratch->folder, .epoch_ns = 6};
    assert_int_equal(bus_create(&array, &cfg, NULL), 0);
    assert_refused(r, publish_live, array);
    assert_true(node_is_replayed(r->node));
    assert_int_equal(node_now_ns(r->node), 900);
    bus_destroy(array);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_time_is_that_of_the_newest_sound),
        TEST(what_a_node_makes_of_a_replay_is_marked_and_stamped_so),
        TEST(live_sound_does_not_end_a_replay),
        cmocka_unit_test_setup_teardown(a_live_node_refuses_what_is_replayed_and_its_time,
                                        setup_live, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
