/* SPDX-License-Identifier: MIT */
/* "Save the last 30 s": which messages are in which bag, and what is said of it. */
#include "recorder_rig.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <unistd.h>

#include "msgs/bag/manifest.h"
#include "msgs/health.pb-c.h"
#include "nodes/record/snapshot.h"
#include "recorder_full.h"

#define S     1000000000LL
#define START 1772366400000000000LL /* 2026-03-01 12:00:00 UTC */
#define LAST  4000                  /* messages that a test may put */

static struct snapshot_config snapshot_config(struct rig *g, const char *folder)
{
    return (struct snapshot_config){.folder = folder,
                                    .before_ns = 3 * S,
                                    .after_ns = S,
                                    .max_bytes = 100000000,
                                    .on_faults = true,
                                    .topics = g->choice.topics,
                                    .n_topics = g->choice.n,
                                    .session = &g->session,
                                    .say = hear,
                                    .context = g};
}

static struct snapshot *open_snapshot(const struct snapshot_config *cfg)
{
    struct error why = {""};
    struct snapshot *s;

    if (snapshot_create(&s, cfg, &why))
        fail_msg("%s", why.text);
    return s;
}

/* Whatever is due up to then. */
static void step_until(struct snapshot *s, int64_t now_ns)
{
    while (snapshot_due_ns(s) <= now_ns)
        snapshot_step(s, now_ns);
}

/* Message i of the rig comes at i hundredths of a second. */
static int64_t time_of(size_t i)
{
    return START + (int64_t)i * (S / 100);
}

static void put_message(struct snapshot *s, size_t i)
{
    static uint8_t payloads[LAST][1024]; /* in the ring for as long as the test runs */
    struct bus_message m = make_message(i, payloads[i]);

    assert_true(i < LAST);
    snapshot_put(s, &m, time_of(i));
    assert_null(m.payload);
    step_until(s, time_of(i));
}

static void put_range(struct snapshot *s, size_t from, size_t to)
{
    for (size_t i = from; i < to; i++)
        put_message(s, i);
}

static Anlos__SaveStatus status_at(const struct snapshot *s, int64_t now_ns)
{
    Anlos__SaveStatus out;

    snapshot_status(s, now_ns, &out);
    return out;
}

static const char *bag_path(struct rig *g, const char *name)
{
    return scratch_path(g->scratch, name);
}

/* [first, last] and nothing else. */
static void check_range(const char *path, size_t first, size_t last)
{
    assert_int_equal(check_bag(path, first), last - first + 1);
}

static void a_bag_has_what_came_so_long_before_the_request_and_so_long_after(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    struct snapshot *s = open_snapshot(&cfg);
    char text[256];

    put_range(s, 0, 1000);
    assert_int_equal(status_at(s, time_of(1000)).state, ANLOS__SAVE_STATUS__STATE__KEEPS);
    assert_true(snapshot_request(s, "hand", "Dog, behind a BUS!", time_of(1000)));
    assert_int_equal(status_at(s, time_of(1000)).state, ANLOS__SAVE_STATUS__STATE__SAVES);
    put_range(s, 1000, 1150);
    const char *path = bag_path(g, "20260301T120010Z_dog-behind-a-bus.mcap");
    assert_string_equal(status_at(s, time_of(1150)).path, path);
    check_range(path, 700, 1100);
    assert_int_equal(status_at(s, time_of(1150)).saved, 1);
    assert_int_equal(status_at(s, time_of(1150)).missing, 0);
    assert_int_equal(status_at(s, time_of(1150)).state, ANLOS__SAVE_STATUS__STATE__KEEPS);
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 0, MANIFEST_REASON, text));
    assert_string_equal(text, "Dog, behind a BUS!");
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 0, MANIFEST_FROM, text));
    assert_string_equal(text, "hand");
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 0, MANIFEST_BEFORE, text));
    assert_string_equal(text, "3");
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 0, MANIFEST_AT_NS, text));
    assert_string_equal(text, "1772366410000000000");
    assert_true(find_metadata(path, MANIFEST_LOST, 0, "ping", text));
    assert_string_equal(text, "0");
    snapshot_destroy(s);
}

static void a_bag_ends_in_time_where_nothing_more_comes(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    struct snapshot *s = open_snapshot(&cfg);

    put_range(s, 0, 10);
    assert_true(snapshot_request(s, "hand", "", time_of(10)));
    step_until(s, time_of(110));
    assert_int_equal(status_at(s, 0).saved, 0);
    step_until(s, time_of(110) + 1);
    assert_int_equal(status_at(s, 0).saved, 1);
    assert_int_equal(snapshot_due_ns(s), INT64_MAX);
    check_range(bag_path(g, "20260301T120000Z_request.mcap"), 0, 9);
    snapshot_destroy(s);
}

static void a_second_request_makes_the_bag_longer_up_to_a_limit(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    struct snapshot *s = open_snapshot(&cfg);
    const char *path = bag_path(g, "20260301T120004Z_one.mcap");
    char text[256];

    put_range(s, 0, 400);
    assert_true(snapshot_request(s, "hand", "one", time_of(400)));
    put_range(s, 400, 450);
    assert_true(snapshot_request(s, "view", "two", time_of(450)));
    put_range(s, 450, 600);
    check_range(path, 100, 550);
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 1, MANIFEST_REASON, text));
    assert_string_equal(text, "two");
    assert_int_equal(status_at(s, 0).joined, 1);
    assert_int_equal(unlink(path), 0);

    /* One each half second, without end: four times 4 s after the first, it ends. */
    for (size_t i = 600; i < 2400; i++) {
        if (i % 50 == 0)
            assert_true(snapshot_request(s, "can", "on", time_of(i)));
        put_message(s, i);
    }
    check_range(bag_path(g, "20260301T120006Z_on.mcap"), 300, 2200);
    const Anlos__SaveStatus t = status_at(s, 0); /* and a bag of its own is under way */
    assert_int_equal(t.saved, 2);
    assert_int_equal(t.state, ANLOS__SAVE_STATUS__STATE__SAVES);
    assert_non_null(strstr(t.path, "Z_on.mcap"));
    snapshot_destroy(s);
}

static void publish_request(struct snapshot *s, uint64_t id, const char *reason,
                            int64_t now_ns)
{
    static uint8_t rooms[8][64];
    static size_t n;
    uint8_t *room = rooms[n++ % 8];
    Anlos__SaveRequest r = ANLOS__SAVE_REQUEST__INIT;
    struct bus_message m = {.topic = topic_save(), .payload = room};

    r.id = id;
    r.reason = (char *)reason;
    snprintf(m.envelope.topic, sizeof m.envelope.topic, "%s", m.topic->name);
    snprintf(m.envelope.node, sizeof m.envelope.node, "page");
    m.envelope.epoch_ns = EPOCH_NS;
    m.envelope.payload_size = (uint32_t)anlos__save_request__pack(&r, room);
    snapshot_put(s, &m, now_ns);
}

static void a_message_asks_and_one_that_is_repeated_asks_once(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    struct snapshot *s = open_snapshot(&cfg);

    assert_true(snapshot_wants(s, topic_save()));
    publish_request(s, 7, "topic", START);
    assert_int_equal(status_at(s, START).request_id, 7);
    for (size_t i = 0; i < 5; i++)
        publish_request(s, 7, "topic", START);
    assert_int_equal(status_at(s, START).joined, 0);
    publish_request(s, 8, "topic", START);
    assert_int_equal(status_at(s, START).joined, 1);
    publish_request(s, 0, "no number", START); /* each one counts */
    publish_request(s, 0, "no number", START);
    assert_int_equal(status_at(s, START).joined, 3);
    snapshot_end(s, START);
    assert_int_equal(access(bag_path(g, "20260301T120000Z_topic.mcap"), F_OK), 0);
    snapshot_destroy(s);
}

static void publish_fault(struct snapshot *s, const char *name, uint32_t count,
                          int64_t now_ns)
{
    static uint8_t rooms[64][128];
    static size_t n;
    uint8_t *room = rooms[n++ % 64];
    Anlos__Health h = ANLOS__HEALTH__INIT;
    Anlos__Fault f = ANLOS__FAULT__INIT, *list[] = {&f};
    struct bus_message m = {.topic = topic_health(), .payload = room};

    f.name = (char *)name;
    f.count = count;
    h.node = (char *)"dsp";
    h.faults = list;
    h.n_faults = 1;
    h.state = ANLOS__HEALTH__STATE__READY;
    snprintf(m.envelope.topic, sizeof m.envelope.topic, "%s", m.topic->name);
    snprintf(m.envelope.node, sizeof m.envelope.node, "dsp");
    m.envelope.epoch_ns = EPOCH_NS;
    m.envelope.payload_size = (uint32_t)anlos__health__pack(&h, room);
    snapshot_put(s, &m, now_ns);
    step_until(s, now_ns);
}

static void a_new_fault_is_saved_once_and_again_after_an_hour(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    struct snapshot *s = open_snapshot(&cfg);
    char text[256];

    assert_true(snapshot_wants(s, topic_health()));
    publish_fault(s, "channels_silent", 0, START);
    assert_int_equal(status_at(s, START).state, ANLOS__SAVE_STATUS__STATE__KEEPS);
    for (int64_t k = 1; k < 20; k++) /* it lasts */
        publish_fault(s, "channels_silent", 3, START + k * S);
    assert_int_equal(status_at(s, START).saved, 1);
    const char *path = bag_path(g, "20260301T120001Z_channels-silent.mcap");
    assert_true(find_metadata(path, MANIFEST_SNAPSHOT, 0, MANIFEST_FROM, text));
    assert_string_equal(text, "dsp");

    publish_fault(s, "channels_silent", 0, START + 20 * S); /* flickers */
    publish_fault(s, "channels_silent", 1, START + 21 * S);
    publish_fault(s, "speakers_mute", 1, START + 30 * S); /* another one */
    publish_fault(s, "speakers_mute", 1, START + 40 * S);
    assert_int_equal(status_at(s, START).saved, 2);
    assert_int_equal(snapshot_faults_again(s), 1);

    publish_fault(s, "channels_silent", 0, START + 50 * S);
    publish_fault(s, "channels_silent", 1, START + 3601 * S);
    publish_fault(s, "channels_silent", 1, START + 3610 * S);
    assert_int_equal(status_at(s, START).saved, 3);
    snapshot_destroy(s);
}

static void what_the_bus_lost_is_told_of_the_time_of_the_bag(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    struct snapshot *s = open_snapshot(&cfg);
    char text[256];

    put_range(s, 0, 100);
    snapshot_lost(s, topic_ping(), 40, time_of(100)); /* long before */
    put_range(s, 100, 600);
    snapshot_lost(s, topic_ping(), 42, time_of(600));
    put_range(s, 600, 800);
    assert_true(snapshot_request(s, "hand", "lost", time_of(800)));
    snapshot_lost(s, topic_ping(), 43, time_of(850));
    put_range(s, 800, 1000);
    assert_true(find_metadata(bag_path(g, "20260301T120008Z_lost.mcap"), MANIFEST_LOST, 0,
                              "ping", text));
    assert_string_equal(text, "3");
    snapshot_destroy(s);
}

/* Nobody writes while the ring overflows: the oldest are missing, and counted. */
static void what_the_ring_loses_of_a_bag_is_told(void **state)
{
    struct rig *g = *state;
    struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    uint8_t payload[PAYLOAD_MAX];
    struct bag_catalog *c;
    uint64_t lost = 0;
    char text[256];

    cfg.max_bytes = 200000;
    struct snapshot *s = open_snapshot(&cfg);
    put_range(s, 0, 100);
    assert_true(snapshot_request(s, "hand", "slow", time_of(100)));
    for (size_t i = 100; i < 1000; i++) {
        struct bus_message m = make_message(i, payload);
        snapshot_put(s, &m, time_of(100));
    }
    snapshot_end(s, time_of(100));
    const char *path = bag_path(g, "20260301T120001Z_slow.mcap");
    assert_int_equal(bag_catalog_open(&c, path, NULL), 0);
    for (size_t i = 0; i < 3; i++) {
        assert_true(find_metadata(path, MANIFEST_LOST, 0, topic_of(i)->name, text));
        lost += (uint64_t)atoll(text);
    }
    assert_true(lost > 500);
    assert_int_equal(c->n_messages + lost, 1000);
    assert_int_equal(status_at(s, 0).missing, lost);
    bag_catalog_close(c);
    snapshot_destroy(s);
}

static void a_ring_that_holds_less_than_was_asked_for_says_so(void **state)
{
    struct rig *g = *state;
    struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);

    cfg.max_bytes = 100000;
    struct snapshot *s = open_snapshot(&cfg);
    put_range(s, 0, 2000);
    assert_contains(g->said, "of the last 3 s the snapshot's 0 MB hold");
    assert_contains(g->said, "max_mb");
    assert_null(strstr(strchr(g->said, '\n') + 1, "hold")); /* once */
    assert_true(status_at(s, time_of(2000)).kept_bytes <= 100000);
    snapshot_destroy(s);
}

static void without_a_ring_a_request_is_refused_and_counted(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, NULL);
    struct snapshot *s = open_snapshot(&cfg);

    put_range(s, 0, 10);
    assert_true(snapshot_wants(s, topic_save()));
    assert_false(snapshot_wants(s, topic_health()));
    publish_request(s, 5, "why not", START);
    const Anlos__SaveStatus t = status_at(s, START);
    assert_int_equal(t.state, ANLOS__SAVE_STATUS__STATE__KEEPS_NOTHING);
    assert_int_equal(t.request_id, 5);
    assert_int_equal(t.refused, 1);
    assert_contains(t.error, "--snapshot FOLDER");
    assert_contains(g->said, "keeps none of them");
    snapshot_destroy(s);
}

static void a_folder_that_goes_fails_one_bag_and_the_ring_lives_on(void **state)
{
    struct rig *g = *state;
    char folder[128];

    snprintf(folder, sizeof folder, "%s/new/deep", g->scratch->folder);
    const struct snapshot_config cfg = snapshot_config(g, folder);
    struct snapshot *s = open_snapshot(&cfg);
    put_range(s, 0, 400);
    assert_int_equal(rmdir(folder), 0);
    assert_false(snapshot_request(s, "hand", "gone", time_of(400)));
    assert_int_equal(status_at(s, 0).failed, 1);
    assert_contains(status_at(s, 0).error, "No such file or directory");
    assert_contains(g->said, "not saved (gone): ");
    assert_int_equal(mkdir(folder, 0777), 0);
    assert_true(snapshot_request(s, "hand", "back", time_of(400)));
    put_range(s, 400, 600);
    assert_string_equal(status_at(s, 0).error, "");
    check_range(bag_path(g, "new/deep/20260301T120004Z_back.mcap"), 100, 500);
    snapshot_destroy(s);
}

static void a_folder_that_cannot_be_written_is_refused_at_the_start(void **state)
{
    struct rig *g = *state;
    struct snapshot *s;
    struct error why = {""};
    const struct snapshot_config cfg =
        snapshot_config(g, scratch_write(g->scratch, "file", "x"));

    assert_int_equal(snapshot_create(&s, &cfg, &why), -ENOTDIR);
    assert_contains(why.text, "file");
}

/* Of 100 kB; exit code 0: as it should be. */
static int fill(struct rig *g)
{
    const struct rlimit limit = {100000, 100000};
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);

    signal(SIGXFSZ, SIG_IGN);
    struct snapshot *s = open_snapshot(&cfg);
    put_range(s, 0, 400); /* some 550 bytes each */
    if (setrlimit(RLIMIT_FSIZE, &limit) ||
        !snapshot_request(s, "hand", "full", time_of(400)))
        return 2;
    put_range(s, 400, 600);
    const Anlos__SaveStatus t = status_at(s, time_of(600));
    uint64_t n = count_messages(bag_path(g, "20260301T120004Z_full.mcap"));
    if (t.failed != 1 || t.saved || !strstr(t.error, "File too large") ||
        !strstr(t.error, "it has the first"))
        return 3;
    uint64_t n_faults;
    if (bag_check(&n_faults, bag_path(g, "20260301T120004Z_full.mcap"), NULL, NULL) ||
        n_faults)
        return 4;
    if (n + t.missing < 300 || t.kept_s < 2.9)
        return 5;
    snapshot_destroy(s);
    return 0;
}

static void a_full_disk_leaves_a_whole_bag_and_the_ring(void **state)
{
    assert_int_equal(run_child(*state, fill), 0);
}

static void the_end_of_the_recorder_ends_a_bag_with_what_there_is(void **state)
{
    struct rig *g = *state;
    const struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);
    struct snapshot *s = open_snapshot(&cfg);

    put_range(s, 0, 400);
    assert_true(snapshot_request(s, "hand", "end", time_of(400)));
    put_range(s, 400, 420);
    snapshot_destroy(s);
    check_range(bag_path(g, "20260301T120004Z_end.mcap"), 100, 419);
}

static void two_bags_of_one_second_have_two_names(void **state)
{
    struct rig *g = *state;
    struct snapshot_config cfg = snapshot_config(g, g->scratch->folder);

    cfg.after_ns = 0;
    struct snapshot *s = open_snapshot(&cfg);
    put_range(s, 0, 10);
    assert_true(snapshot_request(s, "hand", "../a/b", time_of(10)));
    step_until(s, time_of(11));
    assert_true(snapshot_request(s, "hand", "../a/b", time_of(12)));
    step_until(s, time_of(13));
    check_range(bag_path(g, "20260301T120000Z_a-b.mcap"), 0, 9);
    check_range(bag_path(g, "20260301T120000Z_a-b-2.mcap"), 0, 9);
    snapshot_destroy(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG_TEST(a_bag_has_what_came_so_long_before_the_request_and_so_long_after),
        RIG_TEST(a_bag_ends_in_time_where_nothing_more_comes),
        RIG_TEST(a_second_request_makes_the_bag_longer_up_to_a_limit),
        RIG_TEST(a_message_asks_and_one_that_is_repeated_asks_once),
        RIG_TEST(a_new_fault_is_saved_once_and_again_after_an_hour),
        RIG_TEST(what_the_bus_lost_is_told_of_the_time_of_the_bag),
        RIG_TEST(what_the_ring_loses_of_a_bag_is_told),
        RIG_TEST(a_ring_that_holds_less_than_was_asked_for_says_so),
        RIG_TEST(without_a_ring_a_request_is_refused_and_counted),
        RIG_TEST(a_folder_that_goes_fails_one_bag_and_the_ring_lives_on),
        RIG_TEST(a_folder_that_cannot_be_written_is_refused_at_the_start),
        RIG_TEST(a_full_disk_leaves_a_whole_bag_and_the_ring),
        RIG_TEST(the_end_of_the_recorder_ends_a_bag_with_what_there_is),
        RIG_TEST(two_bags_of_one_second_have_two_names),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
