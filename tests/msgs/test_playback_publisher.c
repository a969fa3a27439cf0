/* SPDX-License-Identifier: MIT */
/* A bus listens to somebody who speaks under the names of others. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/msgs/run_folder.h"

#include "msgs/playback_publisher.h"
#include "msgs/scan.pb-c.h"

#define EPOCH 77

static struct playback_publisher *create(void)
{
    struct playback_publisher *s = NULL;

    assert_int_equal(playback_publisher_create(&s, run_folder, EPOCH, NULL), 0);
    return s;
}

static struct bus *listen(const struct topic *t)
{
    const struct bus_config cfg = {.run_dir = run_folder, .listen_only = true};
    struct bus *b = NULL;

    assert_int_equal(bus_create(&b, &cfg, NULL), 0);
    assert_int_equal(bus_subscribe(b, t), 0);
    return b;
}

static int say(struct playback_publisher *s, const char *text)
{
    return playback_publisher_publish(s, "scan", topic_scan_status(), 0, 5, text,
                                      strlen(text));
}

/* Until a message comes: what is sent before the listener is connected is lost. */
static struct bus_message hear(struct playback_publisher *s, struct bus *b,
                               const char *text)
{
    struct bus_message m = {0};
    int64_t end = now_ms() + DEADLINE_MS;

    while (bus_receive(b, &m, 10) == -ETIMEDOUT) {
        assert_true(now_ms() < end);
        assert_int_equal(say(s, text), 0);
    }
    return m;
}

static void it_speaks_under_the_other_s_name_in_its_own_epoch(void **state)
{
    struct playback_publisher *s = create();
    struct bus *b = listen(topic_scan_status());

    (void)state;
    assert_int_equal(playback_publisher_add(s, "scan", topic_scan_status(), NULL), 0);
    assert_int_equal(playback_publisher_add(s, "scan", topic_scan_status(), NULL), 0);
    struct bus_message m = hear(s, b, "abc");
    assert_string_equal(m.envelope.node, "scan");
    assert_string_equal(m.envelope.topic, "scan/status");
    assert_int_equal(m.envelope.epoch_ns, EPOCH);
    assert_int_equal(m.envelope.publish_ns, 5);
    assert_int_equal(m.envelope.capture_ns, 0);
    assert_true(m.envelope.replayed);
    assert_memory_equal(m.payload, "abc", 3);
    bus_message_free(&m);
    assert_int_equal(count_of(b, topic_scan_status(), false).peers, 1);
    bus_destroy(b);
    playback_publisher_destroy(s);
}

/* Of each part, sent right away, in each of many playbacks. */
static void who_keeps_all_hears_the_first_message(void **state)
{
    struct bus *b = open_bus("record", 1);

    (void)state;
    bus_keep_all(b, 1 << 20, 1);
    assert_int_equal(bus_subscribe(b, topic_scan_status()), 0);
    assert_int_equal(bus_subscribe(b, topic_survey()), 0);
    for (int i = 0; i < 20; i++) {
        struct playback_publisher *s = create();
        assert_int_equal(playback_publisher_add(s, "scan", topic_scan_status(), NULL), 0);
        assert_int_equal(playback_publisher_add(s, "array", topic_survey(), NULL), 0);
        assert_int_equal(playback_publisher_await_recorders(s), 0);
        assert_int_equal(say(s, "abc"), 0);
        assert_int_equal(
            playback_publisher_publish(s, "array", topic_survey(), 0, 5, "d", 1), 0);
        for (int k = 0; k < 2; k++) {
            struct bus_message m = {0};
            assert_int_equal(bus_receive(b, &m, DEADLINE_MS), 0);
            assert_int_equal(m.envelope.sequence, 0);
            bus_message_free(&m);
        }
        playback_publisher_destroy(s);
    }
    bus_destroy(b);
}

static void what_was_not_added_cannot_be_said(void **state)
{
    struct playback_publisher *s = create();

    (void)state;
    assert_int_equal(say(s, "a"), -EINVAL);
    assert_int_equal(playback_publisher_add(s, "dsp", topic_scan_status(), NULL),
                     -EINVAL);
    assert_int_equal(playback_publisher_add(s, "scan", topic_scan_status(), NULL), 0);
    assert_true(playback_publisher_has(s, "scan", topic_scan_status()));
    assert_false(playback_publisher_has(s, "scan", topic_fire()));
    assert_string_equal(playback_publisher_node(s, 0), "scan");
    assert_null(playback_publisher_node(s, 1));
    static char large[5000];
    assert_int_equal(playback_publisher_publish(s, "scan", topic_scan_status(), 0, 1,
                                                large, sizeof large),
                     -EMSGSIZE);
    playback_publisher_destroy(s);
}

/* nanomsg drops what comes while the one before is not with the kernel. */
static void what_is_larger_than_the_kernel_s_buffer_goes_one_by_one(void **state)
{
    struct playback_publisher *s = create();
    const struct topic *t = topic_scan_status();

    (void)state;
    assert_int_equal(playback_publisher_window(s, "scan", t, 1),
                     1); /* not added: nothing is sure */
    assert_int_equal(playback_publisher_add(s, "scan", t, NULL), 0);
    assert_int_equal(playback_publisher_window(s, "scan", t, (size_t)1 << 30), 1);
    size_t small = playback_publisher_window(s, "scan", t, 1000);
    assert_true(small > playback_publisher_window(s, "scan", t, 10000));
    playback_publisher_destroy(s);
}

static void nobody_can_be_there_twice(void **state)
{
    struct playback_publisher *s = create();
    const struct bus_config cfg = {.node = "scan", .run_dir = run_folder};
    struct error why;
    struct bus *b = open_bus("scan", 1);

    (void)state;
    assert_int_equal(playback_publisher_add(s, "scan", topic_scan_status(), NULL),
                     -EADDRINUSE);
    bus_destroy(b);
    assert_int_equal(playback_publisher_add(s, "scan", topic_scan_status(), NULL), 0);
    assert_int_equal(bus_create(&b, &cfg, &why), -EADDRINUSE);
    playback_publisher_destroy(s);
    b = open_bus("scan", 2);
    bus_destroy(b);
}

/* The world of a bus decides, whatever the topic: of every one something is replayed,
 * then the same is said live. */
static void what_is_of_another_world_is_refused_on_every_topic(void **state)
{
    (void)state;
    for (const struct topic *t = topics_all(); t->name; t++) {
        const char *name = topic_publisher(t, 0);
        bool of_itself = t == topic_health() || t == topic_log() || t == topic_host();
        for (enum bus_world world = BUS_LIVE; world <= BUS_REPLAY; world++) {
            for (int live = 0; live < 2; live++) {
                const struct bus_config cfg = {
                    .run_dir = run_folder, .listen_only = true, .world = world};
                struct playback_publisher *s = live ? NULL : create();
                struct bus *b = NULL, *other = live ? open_bus(name, 1) : NULL;
                struct bus_message m;
                bool heard = false;
                int64_t end = now_ms() + DEADLINE_MS;
                assert_int_equal(bus_create(&b, &cfg, NULL), 0);
                assert_int_equal(bus_subscribe(b, t), 0);
                assert_true(live || !playback_publisher_add(s, name, t, NULL));
                while (!heard && !bus_refused(b)) {
                    assert_true(now_ms() < end);
                    assert_int_equal(
                        live ? bus_publish(other, t, 0, 5, "", 0)
                             : playback_publisher_publish(s, name, t, 0, 5, "", 0),
                        0);
                    heard = !bus_receive(b, &m, 1);
                }
                if (heard)
                    bus_message_free(&m);
                bool takes = world == BUS_LIVE ? live && t != topic_clock()
                                               : !live || of_itself;
                assert_int_equal(heard, takes);
                bus_destroy(b);
                bus_destroy(other);
                playback_publisher_destroy(s);
            }
        }
    }
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, make_run_folder, remove_run_folder)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_speaks_under_the_other_s_name_in_its_own_epoch),
        TEST(who_keeps_all_hears_the_first_message),
        TEST(what_was_not_added_cannot_be_said),
        TEST(what_is_larger_than_the_kernel_s_buffer_goes_one_by_one),
        TEST(nobody_can_be_there_twice),
        TEST(what_is_of_another_world_is_refused_on_every_topic),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
