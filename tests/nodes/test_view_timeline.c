/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include <errno.h>
#include <unistd.h>

#include "msgs/bag/topic_message.h"
#include "msgs/detections.pb-c.h"
#include "msgs/health.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "nodes/view/timeline.h"
#include "tests/nodes/near.h"

#define MS 1000000LL
#define T0 (1795000000LL * 1000 * MS)

struct bag {
    struct bag_writer *writer;
    struct bag_topics *topics;
};

static void put(struct bag *b, const struct topic *topic, const char *node, int64_t at_ms,
                const void *content)
{
    struct envelope e = {.epoch_ns = 3, .publish_ns = T0 + at_ms * MS};
    struct error why = {""};
    size_t size = protobuf_c_message_get_packed_size(content);
    uint8_t *payload = malloc(size + 1);

    assert_non_null(payload);
    protobuf_c_message_pack(content, payload);
    snprintf(e.topic, sizeof e.topic, "%s", topic->name);
    snprintf(e.node, sizeof e.node, "%s", node);
    e.payload_size = (uint32_t)size;
    if (bag_topics_put(b->topics, &e, payload, NULL, &why))
        fail_msg("%s", why.text);
    free(payload);
}

static void put_status(struct bag *b, int64_t at_ms, uint32_t done)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    s.text = (char *)"";
    s.pings_done = done;
    put(b, topic_scan_status(), "scan", at_ms, &s);
}

static void put_health(struct bag *b, int64_t at_ms, const char *node)
{
    Anlos__Health h = ANLOS__HEALTH__INIT;

    h.node = (char *)node;
    h.text = (char *)"";
    h.uptime_s = 1e-3 * (double)at_ms;
    put(b, topic_health(), node, at_ms, &h);
}

static void put_list(struct bag *b, int64_t at_ms, uint32_t counter)
{
    Anlos__DetectionList l = ANLOS__DETECTION_LIST__INIT;

    l.counter = counter;
    put(b, topic_detections(), "track", at_ms, &l);
}

static void put_line(struct bag *b, int64_t at_ms)
{
    Anlos__Log l = ANLOS__LOG__INIT;

    l.node = (char *)"dsp";
    l.text = (char *)"something";
    l.stamp_ns = at_ms;
    put(b, topic_log(), "dsp", at_ms, &l);
}

struct seen {
    int64_t status_ms, array_ms, track_ms, line_ms; /* -1: nothing of it */
    int lines, all;
    int64_t newest_ns;
};

static void take(void *ctx, const struct view_message *m)
{
    struct seen *s = ctx;
    int64_t ms = (m->publish_ns - T0) / MS;

    s->all++;
    assert_true(m->publish_ns >= s->newest_ns); /* in their order */
    s->newest_ns = m->publish_ns;
    assert_int_equal(m->epoch_ns, 3);
    if (m->topic == topic_scan_status()) {
        s->status_ms = ms;
    } else if (m->topic == topic_health()) {
        const Anlos__Health *h = (const Anlos__Health *)m->content;
        *(strcmp(h->node, "array") ? &s->track_ms : &s->array_ms) = ms;
        assert_string_equal(h->node, m->from);
    } else if (m->topic == topic_log()) {
        s->lines++;
        s->line_ms = ms;
    }
}

static struct seen look(struct timeline *t, int64_t at_ms)
{
    struct seen s = {-1, -1, -1, -1, 0, 0, 0};
    struct error why = {""};

    assert_int_equal(timeline_at(t, T0 + at_ms * MS, take, &s, &why), 0);
    return s;
}

/* Chunks that hold a few messages each, some of which came late: what a node has sent
 * at 995 ms stands behind what another has sent at 1010 ms, in the next chunk. */
static void write_bag(const char *path, enum bag_compression compression)
{
    const struct bag_writer_config cfg = {
        .profile = "", .library = "test", .chunk_size = 300, .compression = compression};
    struct error why = {""};
    struct bag b;

    assert_int_equal(bag_writer_create(&b.writer, path, &cfg, &why), 0);
    assert_int_equal(bag_topics_create(&b.topics, b.writer), 0);
    put_health(&b, 0, "array");
    put_line(&b, 100);
    for (int k = 1; k <= 40; k++) {
        put_status(&b, 100 * k + 10, (uint32_t)k);
        if (k % 10 == 0)
            put_health(&b, 100 * k - 5, "array"); /* late */
        if (k == 7)
            put_health(&b, 700, "track");
    }
    put_line(&b, 4100);
    bag_topics_destroy(b.topics);
    assert_int_equal(bag_writer_close(b.writer, &why), 0);
}

static void check_places(const char *path)
{
    struct error why = {""};
    struct timeline *t;
    int64_t start, end;

    if (timeline_open(&t, path, &why))
        fail_msg("%s", why.text);
    timeline_span(t, &start, &end);
    assert_int_equal(start, T0);
    assert_int_equal(end, T0 + 4100 * MS);
    struct seen s = look(t, -1);
    assert_int_equal(s.all, 0);
    s = look(t, 0);
    assert_int_equal(s.all, 1);
    assert_int_equal(s.array_ms, 0);
    for (int64_t at = 1; at < 4200; at += 7) {
        int64_t k = (at - 10) / 100 < 40 ? (at - 10) / 100 : 40;
        int64_t late = (at + 5) / 1000 * 1000 - 5;
        s = look(t, at);
        assert_int_equal(s.status_ms, at < 110 ? -1 : 100 * k + 10);
        assert_int_equal(s.array_ms, at < 995 ? 0 : late < 3995 ? late : 3995);
        assert_int_equal(s.track_ms, at < 700 ? -1 : 700);
        assert_int_equal(s.line_ms, at < 100 ? -1 : at < 4100 ? 100 : 4100);
    }
    timeline_close(t);
}

static void the_state_at_a_time_is_the_newest_of_everything(void **state)
{
    struct scratch *s = *state;

    write_bag(scratch_path(s, "bag.mcap"), BAG_NONE);
    check_places(s->path);
    write_bag(scratch_path(s, "zstd.mcap"), BAG_ZSTD);
    check_places(s->path);
}

struct lists {
    int n;
    int64_t newest_ms;
};

static void take_list(void *ctx, const struct view_message *m)
{
    struct lists *l = ctx;
    int64_t ms = (m->publish_ns - T0) / MS;

    if (m->topic != topic_detections())
        return;
    assert_true(ms > l->newest_ms); /* each once, in their order */
    l->newest_ms = ms;
    l->n++;
}

/* Lists every 250 ms up to 10 s, and one at 20 s: of the last 3 s all are given, and the
 * newest where there are none. */
static void lists_of_objects_are_given_as_far_back_as_trails_go(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};

    for (int k = 0; k < 2; k++) {
        const struct bag_writer_config cfg = {.profile = "",
                                              .library = "test",
                                              .chunk_size = 300,
                                              .compression = k ? BAG_ZSTD : BAG_NONE};
        struct bag b;
        struct timeline *t;
        assert_int_equal(
            bag_writer_create(&b.writer, scratch_path(s, k ? "z" : "n"), &cfg, &why), 0);
        assert_int_equal(bag_topics_create(&b.topics, b.writer), 0);
        for (int i = 0; i <= 40; i++)
            put_list(&b, 250 * i, (uint32_t)i);
        put_list(&b, 20000, 41);
        put_line(&b, 30000);
        bag_topics_destroy(b.topics);
        assert_int_equal(bag_writer_close(b.writer, &why), 0);
        if (timeline_open(&t, s->path, &why))
            fail_msg("%s", why.text);
        for (int64_t at = 0; at < 30000; at += 130) {
            struct lists l = {0, -1};
            int64_t newest = at >= 20000 ? 20000 : at >= 10000 ? 10000 : at / 250 * 250;
            int64_t oldest = at > 3000 ? (at - 3000 + 249) / 250 * 250 : 0;
            int n = at >= 20000        ? 1
                    : newest >= oldest ? (int)((newest - oldest) / 250) + 1
                                       : 1;
            assert_int_equal(timeline_at(t, T0 + at * MS, take_list, &l, &why), 0);
            assert_int_equal(l.newest_ms, newest);
            assert_int_equal(l.n, n);
        }
        timeline_close(t);
    }
}

static bool never(void *ctx)
{
    (void)ctx;
    return false;
}

static bool at_once(void *ctx)
{
    ++*(int *)ctx;
    return true;
}

struct each {
    unsigned seen; /* bits of the lists by their counters */
    int n, most;   /* it stops after so many; 0: never */
};

static void take_each(void *ctx, const struct view_message *m)
{
    struct each *e = ctx;
    const Anlos__DetectionList *l = (const Anlos__DetectionList *)m->content;

    assert_ptr_equal(m->topic, topic_detections());
    assert_int_equal(m->publish_ns, T0 + 100 * MS * (int64_t)l->counter);
    assert_false(e->seen >> l->counter & 1);
    e->seen |= 1u << l->counter;
    e->n++;
}

static bool has_enough(void *ctx)
{
    const struct each *e = ctx;

    return e->most && e->n >= e->most;
}

/* Between other things, in chunks with and without one. */
static void every_list_of_a_bag_is_given_once_however_often_it_is_stopped(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};

    for (int k = 0; k < 4; k++) {
        const struct bag_writer_config cfg = {.profile = "",
                                              .library = "test",
                                              .chunk_size = 200,
                                              .compression = k & 1 ? BAG_ZSTD : BAG_NONE};
        struct each e = {.most = k & 2 ? 0 : 1};
        struct timeline *t;
        struct bag b;
        int calls = 1;
        assert_int_equal(
            bag_writer_create(&b.writer, scratch_path(s, k & 1 ? "z" : "n"), &cfg, &why),
            0);
        assert_int_equal(bag_topics_create(&b.topics, b.writer), 0);
        for (unsigned i = 0; i < 30; i++) {
            put_list(&b, 100 * i, i);
            for (int j = 0; j < (i % 5 ? 1 : 9); j++)
                put_line(&b, 100 * i + 1 + j);
        }
        bag_topics_destroy(b.topics);
        assert_int_equal(bag_writer_close(b.writer, &why), 0);
        assert_int_equal(timeline_open(&t, s->path, &why), 0);
        for (; timeline_lists(t, take_each, has_enough, &e) == -EINTR; calls++)
            e.n = 0;
        assert_int_equal(e.seen, (1u << 30) - 1);
        assert_true((calls > 5) == !(k & 2));
        assert_int_equal(timeline_lists(t, take_each, has_enough, &e), 0);
        timeline_close(t);
        assert_int_equal(unlink(s->path), 0);
    }
}

static void a_bag_of_the_last_seconds_says_when_and_why(void **state)
{
    struct scratch *s = *state;
    const struct bag_writer_config cfg = {.profile = "", .library = "test"};
    struct bytes_buffer map = {0};
    struct error why = {""};
    struct timeline *t;
    struct bag b;
    char reason[20] = "";
    int64_t at_ns = 0;

    assert_int_equal(bag_writer_create(&b.writer, scratch_path(s, "s"), &cfg, &why), 0);
    assert_int_equal(bag_topics_create(&b.topics, b.writer), 0);
    put_line(&b, 1);
    bag_map_put(&map, bytes_of("reason"), bytes_of("cyclist behind an \xc3\xa4lm"));
    bag_map_put(&map, bytes_of("at_ns"), bytes_of("1795000000123456789"));
    const struct bag_metadata m = {.name = bytes_of("anlos.snapshot"),
                                   .metadata = bytes_in(&map)};
    assert_int_equal(bag_writer_metadata(b.writer, &m, &why), 0);
    bytes_free(&map);
    bag_topics_destroy(b.topics);
    assert_int_equal(bag_writer_close(b.writer, &why), 0);
    assert_int_equal(timeline_open(&t, s->path, &why), 0);
    assert_true(timeline_saved(t, &at_ns, reason, sizeof reason));
    assert_string_equal(reason, "cyclist behind an ?"); /* half a character is none */
    assert_true(at_ns == 1795000000123456789);
    timeline_close(t);
    write_bag(scratch_path(s, "bag.mcap"), BAG_NONE);
    assert_int_equal(timeline_open(&t, s->path, &why), 0);
    assert_false(timeline_saved(t, &at_ns, reason, sizeof reason));
    timeline_close(t);
}

/* One letter of what the log says, which is in the first chunk and in the last. */
static void damage_is_found_after_it_was_shown(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct timeline *t;
    char whole[4096 * 4];

    write_bag(scratch_path(s, "bag.mcap"), BAG_NONE);
    FILE *f = fopen(s->path, "r+b");
    assert_non_null(f);
    size_t n = fread(whole, 1, sizeof whole, f);
    char *at = memmem(whole, n, "something", 9);
    assert_non_null(at);
    assert_int_equal(fseek(f, at - whole, SEEK_SET), 0);
    assert_int_equal(fputc('S', f), 'S');
    fclose(f);
    assert_int_equal(timeline_open(&t, s->path, &why), 0);
    look(t, 100);
    int asked = 0; /* whoever wants another place meanwhile does not wait for it */
    assert_int_equal(timeline_check(t, at_once, &asked, &why), -EINTR);
    assert_int_equal(asked, 1);
    assert_int_equal(timeline_check(t, never, NULL, &why), -EBADMSG);
    assert_non_null(strstr(why.text, "checksum"));
    look(t, 4100); /* it needs another chunk for the line, and not this one */
    assert_int_equal(timeline_check(t, never, NULL, &why), 0);
    timeline_close(t);
}

static void a_bag_that_was_cut_is_refused_with_a_way_out(void **state)
{
    struct scratch *s = *state;
    struct error why = {""};
    struct timeline *t;
    struct stat whole;

    write_bag(scratch_path(s, "bag.mcap"), BAG_NONE);
    assert_int_equal(stat(s->path, &whole), 0);
    assert_int_equal(truncate(s->path, whole.st_size / 3), 0);
    assert_int_equal(timeline_open(&t, s->path, &why), -EBADMSG);
    assert_non_null(strstr(why.text, "anlos bag recover"));
}

static void a_bag_of_other_things_is_refused(void **state)
{
    struct scratch *s = *state;
    const struct bag_writer_config cfg = {.profile = "", .library = "test"};
    struct error why = {""};
    struct bag_writer *w;
    struct timeline *t;

    assert_int_equal(bag_writer_create(&w, scratch_path(s, "empty.mcap"), &cfg, &why), 0);
    assert_int_equal(bag_writer_close(w, &why), 0);
    assert_int_equal(timeline_open(&t, s->path, &why), -ENODATA);
    assert_non_null(strstr(why.text, "empty.mcap"));
    assert_int_equal(timeline_open(&t, "/nonexistent", &why), -ENOENT);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(the_state_at_a_time_is_the_newest_of_everything),
        TEST(every_list_of_a_bag_is_given_once_however_often_it_is_stopped),
        TEST(a_bag_of_the_last_seconds_says_when_and_why),
        TEST(lists_of_objects_are_given_as_far_back_as_trails_go),
        TEST(damage_is_found_after_it_was_shown),
        TEST(a_bag_that_was_cut_is_refused_with_a_way_out),
        TEST(a_bag_of_other_things_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
