/* SPDX-License-Identifier: MIT */
/* A whole system that records itself. */
#include "record_launch.h"

#include "hal/room/room.h"
#include "msgs/bag/manifest.h"

/* They are there before the recorder is all subscriptions. */
static bool is_older(const char *node)
{
    return !strcmp(node, "launcher") || !strcmp(node, "record");
}

/* From 0 on and without a hole, each topic of each process. */
static void check_sequences(const struct bag_catalog *c)
{
    static struct sender {
        struct bag_source source;
        uint64_t next;
    } senders[64];
    struct bag_cursor *cursor;
    struct error why = {""};
    struct bag_message m;
    size_t n = 0;

    assert_int_equal(bag_cursor_create(&cursor, c), 0);
    while (!bag_cursor_next(cursor, &m, &why)) {
        struct bag_source of;
        size_t i = 0;
        assert_int_equal(bag_source_of(&of, bag_catalog_channel(c, m.channel_id)), 0);
        while (i < n && (senders[i].source.topic != of.topic ||
                         strcmp(senders[i].source.node, of.node) ||
                         senders[i].source.epoch_ns != of.epoch_ns))
            i++;
        assert_true(i < sizeof senders / sizeof *senders);
        if (i == n)
            senders[n++] =
                (struct sender){.source = of, .next = is_older(of.node) ? m.sequence : 0};
        if (m.sequence != senders[i].next)
            fail_msg("%s from %s: %u where %llu comes next", of.topic->name, of.node,
                     m.sequence, (unsigned long long)senders[i].next);
        senders[i].next++;
    }
    bag_cursor_destroy(cursor);
    assert_true(n >= 12);
}

static uint64_t count_topic(const struct bag_catalog *c, const char *topic)
{
    uint64_t n = 0;

    for (size_t i = 0; i < c->n_channels; i++)
        if (bytes_equal(c->channels[i].record.channel.topic, bytes_of(topic)))
            n += c->counts[c->channels[i].record.channel.id];
    return n;
}

static uint64_t pings_of_scene(void)
{
    struct room *room = NULL;

    assert_int_equal(room_load(&room, SCENE, NULL), 0);
    const struct survey *s = room_survey(room);
    uint64_t n = 2 * s->n_positions * s->n_speakers; /* both passes */
    room_destroy(room);
    return n;
}

static void a_system_that_records_itself_has_every_message_from_the_first(void **state)
{
    struct scratch *s = *state;
    char bag[128], text[256];

    write_launch(s);
    snprintf(bag, sizeof bag, "%s/new/folder/a.mcap", s->folder);
    if (launch(s, bag) != 0) {
        said(s, "", true);
        fail();
    }
    assert_true(said(s, ", 0 messages lost", false));
    struct bag_catalog *c = open_catalog(bag);
    assert_false(c->scanned);
    check_sequences(c);
    assert_true(count_topic(c, "ping") >= pings_of_scene());
    assert_true(count_topic(c, "volume") > 0);
    assert_true(count_topic(c, "detections") > 0);
    assert_true(count_topic(c, "survey") > 0);
    bag_catalog_close(c);
    for (const struct topic *t = topics_all(); t->name; t++) {
        assert_true(find_metadata(bag, MANIFEST_LOST, 0, t->name, text));
        assert_string_equal(text, "0");
    }
    assert_true(find_metadata(bag, MANIFEST_GEOMETRY, 0, MANIFEST_SOURCE, text));
    assert_string_equal(text, "SIMULATION");
    assert_true(save_attachment(bag, "launch/launch.yaml", scratch_path(s, "l.yaml")));
    assert_true(save_attachment(bag, "launch/point.yaml", scratch_path(s, "p.yaml")));
    assert_true(save_attachment(bag, MANIFEST_SURVEY, scratch_path(s, "s.yaml")));
}

#define SCRATCH_TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        SCRATCH_TEST(a_system_that_records_itself_has_every_message_from_the_first),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
