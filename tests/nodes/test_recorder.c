/* SPDX-License-Identifier: MIT */
/* The recorder's files: what is in them, when, and in how many. */
#include "recorder_full.h"

#include <errno.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include "msgs/bag/manifest.h"
#include "msgs/bag/recover.h"

static void every_message_is_kept_with_its_bytes_and_stamps(void **state)
{
    static const enum bag_compression compressions[] = {BAG_NONE, BAG_LZ4, BAG_ZSTD};
    struct rig *g = *state;
    struct recorder_config cfg = config(g);

    for (size_t k = 0; k < 4; k++) {
        struct recorder_totals t;
        cfg.compression = compressions[k < 3 ? k : 2];
        cfg.shuffle = k == 3; /* what is not of its schema is kept as it is */
        struct recorder *r = start(&cfg);
        for (size_t i = 0; i < 300; i++)
            put_at(r, i, (int64_t)i * MS);
        end_at(r, 300 * MS);
        recorder_sum(r, &t);
        recorder_destroy(r);
        assert_int_equal(check_bag(g->bag, 0), 300);
        assert_int_equal(t.messages, 300);
        assert_int_equal(t.unwritten, 0);
        assert_int_equal(t.n_files, 1);
        assert_int_equal(unlink(g->bag), 0);
    }
}

/* Messages that a recovery of the file as it is now finds. */
static uint64_t recoverable(struct rig *g)
{
    struct bag_recovery found;
    struct error why = {""};
    const char *saved = scratch_path(g->scratch, "saved.mcap");

    if (bag_recover(&found, g->bag, saved, NULL, &why))
        fail_msg("%s", why.text);
    assert_int_equal(unlink(saved), 0);
    return found.n_messages;
}

static void
a_message_is_in_the_file_after_the_flush_interval_and_not_long_before(void **state)
{
    struct rig *g = *state;
    const struct recorder_config cfg = config(g);
    struct error why = {""};
    struct recorder *r = start(&cfg);
    int64_t due_ns;

    assert_int_equal(recorder_tick(r, 0, &due_ns, &why), 0);
    assert_int_equal(due_ns, INT64_MAX);
    put_at(r, 0, 500 * MS);
    put_at(r, 1, 900 * MS);
    assert_int_equal(recorder_tick(r, 1499 * MS, &due_ns, &why), 0);
    assert_int_equal(due_ns, 1500 * MS);
    assert_int_equal(recoverable(g), 0);
    assert_int_equal(recorder_tick(r, 1500 * MS, &due_ns, &why), 0);
    assert_int_equal(due_ns, INT64_MAX);
    assert_int_equal(recoverable(g), 2);
    recorder_destroy(r);
}

/* Each part is whole by itself, and together they have every message once. */
static size_t check_parts(struct rig *g, unsigned from, unsigned to, size_t first)
{
    size_t n = first;
    char text[256];

    for (unsigned k = from; k <= to; k++) {
        const char *path = part_path(g, k);
        char number[16];
        n += check_bag(path, n);
        assert_true(find_metadata(path, MANIFEST_SESSION, 0, MANIFEST_PART, text));
        snprintf(number, sizeof number, "%u", k);
        assert_string_equal(text, number);
        assert_true(find_metadata(path, MANIFEST_LOST, 0, "ping", text));
        assert_string_equal(text, "0");
    }
    return n;
}

static void a_recording_is_split_by_size(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct recorder_totals t;

    cfg.split_bytes = 50000;
    struct recorder *r = start(&cfg);
    for (size_t i = 0; i < 900; i++)
        put_at(r, i, 0);
    end_at(r, 0);
    recorder_sum(r, &t);
    recorder_destroy(r);
    assert_in_range(t.n_files, 8, 12); /* some 900 * 550 bytes */
    assert_int_equal(check_parts(g, 1, t.n_files, 0), 900);
    assert_int_equal(access(part_path(g, t.n_files + 1), F_OK), -1);
    assert_contains(g->said, "goes on in");
}

static void attachments_larger_than_a_part_do_not_split_every_message_off(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct recorder_totals t;
    char *text = calloc(1, 40001);

    assert_non_null(text);
    memset(text, '#', 40000);
    assert_int_equal(attachments_add_file(&g->session.attachments, "launch/large.yaml",
                                          scratch_write(g->scratch, "large.yaml", text),
                                          NULL),
                     0);
    free(text);
    cfg.split_bytes = 20000;
    struct recorder *r = start(&cfg);
    for (size_t i = 0; i < 900; i++)
        put_at(r, i, 0);
    end_at(r, 0);
    recorder_sum(r, &t);
    recorder_destroy(r);
    /* 900 of 550 bytes and up to 70 of records around them, 40 kB or more in a part. */
    assert_in_range(t.n_files, 4, 14);
    assert_int_equal(check_parts(g, 1, t.n_files, 0), 900);
}

static void a_recording_is_split_by_time(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct recorder_totals t;

    cfg.split_ns = 10000 * MS;
    struct recorder *r = start(&cfg);
    for (size_t i = 0; i < 50; i++)
        put_at(r, i, (int64_t)i * 1000 * MS);
    end_at(r, 50000 * MS);
    recorder_sum(r, &t);
    recorder_destroy(r);
    assert_int_equal(t.n_files, 5);
    assert_int_equal(check_parts(g, 1, 5, 0), 50);
}

static void the_oldest_parts_go_when_the_quota_is_reached(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct recorder_totals t;
    uint64_t on_disk = 0;
    struct stat st;

    cfg.quota_bytes = 200000;
    struct recorder *r = start(&cfg);
    for (size_t i = 0; i < 900; i++) {
        put_at(r, i, (int64_t)i * 10 * MS);
        tick_at(r, (int64_t)i * 10 * MS);
    }
    end_at(r, 9000 * MS);
    recorder_sum(r, &t);
    recorder_destroy(r);
    unsigned last = t.n_files + t.n_removed;
    assert_true(t.n_removed > 0);
    for (unsigned k = 1; k <= last; k++) {
        bool there = !stat(part_path(g, k), &st);
        assert_int_equal(there, k > t.n_removed);
        on_disk += there ? (uint64_t)st.st_size : 0;
    }
    assert_in_range(on_disk, 100000, 200000);
    assert_int_equal(on_disk, t.file_bytes);
    assert_contains(g->said, "the quota is reached");
    struct bag_catalog *c = open_catalog(part_path(g, last));
    assert_int_equal(c->end_time, EPOCH_NS + 899 * 1000);
    bag_catalog_close(c);
}

static void a_quota_without_room_for_two_files_is_refused(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct error why = {""};
    struct recorder *r;

    cfg.quota_bytes = 1000000;
    cfg.split_bytes = 600000;
    assert_int_equal(recorder_create(&r, &cfg, 0, &why), -EINVAL);
    assert_contains(why.text, "quota");
    assert_int_equal(access(part_path(g, 1), F_OK), -1);
}

static void losses_are_written_with_topic_number_and_time(void **state)
{
    struct rig *g = *state;
    const struct recorder_config cfg = config(g);
    struct recorder *r = start(&cfg);
    char text[256];

    put_at(r, 0, 100 * MS);
    recorder_lost(r, topic_ping(), 3);
    tick_at(r, 1100 * MS);
    put_at(r, 1, 1200 * MS);
    tick_at(r, 2200 * MS);
    put_at(r, 2, 2300 * MS);
    recorder_lost(r, topic_ping(), 5);
    recorder_lost(r, topic_volume(), 1);
    end_at(r, 2400 * MS);
    recorder_destroy(r);
    assert_true(find_metadata(g->bag, MANIFEST_LOSS, 0, "ping", text));
    assert_string_equal(text, "3");
    assert_true(find_metadata(g->bag, MANIFEST_LOSS, 0, MANIFEST_FROM_NS, text));
    assert_string_equal(text, "0");
    assert_true(find_metadata(g->bag, MANIFEST_LOSS, 0, MANIFEST_TO_NS, text));
    assert_string_equal(text, "1100000000");
    assert_false(find_metadata(g->bag, MANIFEST_LOSS, 0, "volume", text));
    assert_true(find_metadata(g->bag, MANIFEST_LOSS, 1, "ping", text));
    assert_string_equal(text, "2");
    assert_true(find_metadata(g->bag, MANIFEST_LOSS, 1, MANIFEST_FROM_NS, text));
    assert_string_equal(text, "2200000000");
    assert_false(find_metadata(g->bag, MANIFEST_LOSS, 2, MANIFEST_FROM_NS, text));
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "ping", text));
    assert_string_equal(text, "5");
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "volume", text));
    assert_string_equal(text, "1");
    assert_true(find_metadata(g->bag, MANIFEST_LOST, 0, "traces", text));
    assert_string_equal(text, "0");
}

static int fill_limit(struct rig *g)
{
    const rlim_t schemas = 1 << 16, most = (1 << 20) + schemas;
    const struct rlimit limit = {most, most};

    signal(SIGXFSZ, SIG_IGN);
    return setrlimit(RLIMIT_FSIZE, &limit) ? 1 : fill_disk(g, -EFBIG);
}

static void a_file_that_may_not_grow_ends_it_likewise(void **state)
{
    struct rig *g = *state;

    assert_int_equal(run_child(g, fill_limit), 0);
    assert_in_range(check_bag(g->bag, 0), 900, 3000); /* of some 550 bytes in 1 MB */
}

static void a_file_that_is_there_is_never_written_over(void **state)
{
    struct rig *g = *state;
    struct recorder_config cfg = config(g);
    struct error why = {""};
    struct recorder *r;

    scratch_write(g->scratch, "a.mcap", "an earlier one");
    assert_int_equal(recorder_create(&r, &cfg, 0, &why), -EEXIST);
    assert_contains(why.text, "a.mcap exists already");
    cfg.free_name = true;
    r = start(&cfg);
    assert_contains(recorder_path(r), "/a-2.mcap");
    recorder_destroy(r);
    r = start(&cfg);
    assert_contains(recorder_path(r), "/a-3.mcap");
    recorder_destroy(r);
    scratch_write(g->scratch, "a_0007.mcap", "of an earlier split one");
    cfg.free_name = false;
    cfg.split_ns = MS;
    assert_int_equal(recorder_create(&r, &cfg, 0, &why), -EEXIST);
    assert_contains(why.text, "a_0007.mcap exists already");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        RIG_TEST(every_message_is_kept_with_its_bytes_and_stamps),
        RIG_TEST(a_message_is_in_the_file_after_the_flush_interval_and_not_long_before),
        RIG_TEST(a_recording_is_split_by_size),
        RIG_TEST(attachments_larger_than_a_part_do_not_split_every_message_off),
        RIG_TEST(a_recording_is_split_by_time),
        RIG_TEST(the_oldest_parts_go_when_the_quota_is_reached),
        RIG_TEST(a_quota_without_room_for_two_files_is_refused),
        RIG_TEST(losses_are_written_with_topic_number_and_time),
        RIG_TEST(a_file_that_may_not_grow_ends_it_likewise),
        RIG_TEST(a_file_that_is_there_is_never_written_over),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
