/* SPDX-License-Identifier: MIT */
/* Bags while memory, disk or file give out, at every place where they may. */
#include "bag_rig.h"

#include <errno.h>
#include <unistd.h>

#include "msgs/bag/check.h"
#include "msgs/bag/copy.h"
#include "msgs/bag/cursor.h"
#include "msgs/bag/recover.h"
#include "msgs/bag/summary.h"
#include "msgs/bag/topic_message.h"
#include "tests/failing.h"

enum { N = 24 }; /* messages, two or three to a chunk */

struct bag {
    char from[512], to[512];
    size_t chunk_size;
    enum bag_compression compression;
    bool cut;   /* its footer was taken away */
    int closed; /* what bag_writer_close returned last */
};

/* -- what is written
 * ---------------------------------------------------------------------
 */

static int define(struct bag_writer *w, struct error *why)
{
    const struct bag_schema schema = {.name = bytes_of("text")};
    uint16_t id;
    int err = bag_writer_schema(w, &schema, &id, why);

    for (int i = 0; !err && i < 2; i++) {
        const struct bag_channel channel = {.schema_id = 1,
                                            .topic = bytes_of(i ? "odd" : "even")};
        err = bag_writer_channel(w, &channel, &id, why);
    }
    return err;
}

static int add_rest(struct bag_writer *w, struct error *why)
{
    const struct bag_attachment survey = {.name = bytes_of("survey.yaml"),
                                          .media_type = bytes_of("application/yaml"),
                                          .data = bytes_of("speakers: none")};
    const struct bag_metadata metadata = {.name = bytes_of("anlos")};
    int err = bag_writer_attachment(w, &survey, why);

    return err ? err : bag_writer_metadata(w, &metadata, why);
}

static int add_messages(struct bag_writer *w, struct error *why)
{
    char text[200];
    int err = 0;

    for (size_t i = 0; !err && i < N; i++) {
        const struct bag_message m = {.channel_id = (uint16_t)(1 + i % 2),
                                      .sequence = (uint32_t)i,
                                      .log_time = time_of(i),
                                      .publish_time = time_of(i) + 1,
                                      .data = content(i, text)};
        err = bag_writer_message(w, &m, why);
        if (!err && i == N / 2)
            err = bag_writer_flush(w, why);
    }
    return err;
}

/* Ends the bag, be it after an error. */
static int finish(struct bag *b, struct bag_writer *w, int err, struct error *why)
{
    b->closed = bag_writer_close(w, err ? NULL : why);
    return err ? err : b->closed;
}

static int write_bag(void *context, struct error *why)
{
    struct bag *b = context;
    const struct bag_writer_config cfg = {.profile = "anlos",
                                          .library = "test",
                                          .chunk_size = b->chunk_size,
                                          .compression = b->compression};
    struct bag_writer *w;
    int err = bag_writer_create(&w, b->to, &cfg, why);

    b->closed = err;
    if (err)
        return err;
    err = define(w, why);
    if (!err)
        err = add_rest(w, why);
    if (!err)
        err = add_messages(w, why);
    return finish(b, w, err, why);
}

/* -- what is read
 * ------------------------------------------------------------------------
 */

/* Reads to the end or an error; each message once, and right. */
static int read_all(const char *path, size_t *n, struct error *why)
{
    struct bag_reader *r;
    struct bag_record record;
    bool seen[N] = {false};
    int err = bag_reader_open(&r, path, why);

    *n = 0;
    if (err)
        return err;
    while (!(err = bag_reader_next(r, &record, why))) {
        if (record.opcode != BAG_MESSAGE)
            continue;
        check_message(&record.message);
        assert_true(record.message.sequence < N && !seen[record.message.sequence]);
        seen[record.message.sequence] = true;
        ++*n;
    }
    bag_reader_close(r);
    return err == -ENODATA ? 0 : err;
}

static void tell_fault(void *context, uint64_t offset, const char *what)
{
    (void)context;
    print_error("byte %zu: %s\n", (size_t)offset, what);
}

/* What ends as it should is whole, also after an error; without one everything is in it;
 * and never anything that is not right. */
static void check_written(void *context, int err)
{
    const struct bag *b = context;
    const struct bag_check_watch watch = {.fault = tell_fault};
    struct error why = {""};
    uint64_t faults = 0;
    size_t n = 0;
    int unread = read_all(b->to, &n, &why);

    if (!b->closed && (unread || bag_check(&faults, b->to, &watch, &why) || faults))
        fail_msg("a bag of %zu messages: %s", n, why.text);
    if (!err)
        assert_int_equal(n, N);
    unlink(b->to);
}

static void every_failure_while_writing_is_told(void **state)
{
    static const size_t sizes[] = {0, 300, 1 << 20};

    for (size_t i = 0; i < 3; i++) {
        for (int k = BAG_NONE; k <= BAG_LZ4; k++) {
            struct bag b = {.chunk_size = sizes[i],
                            .compression = (enum bag_compression)k};
            snprintf(b.to, sizeof b.to, "%s", scratch_path(*state, "to.mcap"));
            const struct failing_work work = {.name = "writing",
                                              .run = write_bag,
                                              .check = check_written,
                                              .context = &b};
            assert_true(failing_each(&work) > 20);
        }
    }
}

/* The whole bag that the others are about; b->cut: without its end. */
static void make(struct scratch *s, struct bag *b)
{
    struct error why = {""};

    snprintf(b->from, sizeof b->from, "%s", scratch_path(s, "from.mcap"));
    snprintf(b->to, sizeof b->to, "%s", b->from);
    if (write_bag(b, &why))
        fail_msg("%s", why.text);
    snprintf(b->to, sizeof b->to, "%s", scratch_path(s, "to.mcap"));
    if (b->cut) {
        struct stat st;
        assert_int_equal(stat(b->from, &st), 0);
        assert_int_equal(truncate(b->from, st.st_size - 30), 0);
    }
}

static int read_work(void *context, struct error *why)
{
    const struct bag *b = context;
    size_t n;
    int err = read_all(b->from, &n, why);

    if (!err)
        assert_int_equal(n, N);
    return err;
}

static int read_sorted(const struct bag_catalog *catalog, struct error *why)
{
    struct bytes_buffer into = {0};
    struct bag_record r;
    struct bag_cursor *c;
    struct bag_message m;
    size_t n = 0;
    int err = bag_catalog_read(catalog, &catalog->attachments[0].record, &into, &r, why);

    bytes_free(&into);
    if (err)
        return err;
    if (bag_cursor_create(&c, catalog))
        return error_say(why, -ENOMEM, "out of memory");
    for (uint64_t last = 0; !(err = bag_cursor_next(c, &m, why));
         last = m.log_time, n++) {
        check_message(&m);
        assert_true(m.log_time >= last);
    }
    bag_cursor_destroy(c);
    if (err == -ENODATA)
        assert_int_equal(n, N);
    return err == -ENODATA ? 0 : err;
}

static int catalog_work(void *context, struct error *why)
{
    const struct bag *b = context;
    struct bag_catalog *catalog;
    int err = bag_catalog_open(&catalog, b->from, why);

    if (err)
        return err;
    err = read_sorted(catalog, why);
    bag_catalog_close(catalog);
    return err;
}

/* What is not damaged is never called damaged because it could not be read. */
static int check_work(void *context, struct error *why)
{
    const struct bag *b = context;
    uint64_t faults = 0;
    int err = bag_check(&faults, b->from, NULL, why);

    if (!err)
        assert_int_equal(faults, 0);
    return err;
}

static void every_failure_while_reading_is_told(void **state)
{
    for (int k = BAG_NONE; k <= BAG_LZ4; k++) {
        struct bag b = {.chunk_size = 300, .compression = (enum bag_compression)k};
        make(*state, &b);
        const struct failing_work works[] = {
            {.name = "reading", .run = read_work, .context = &b},
            {.name = "sorting", .run = catalog_work, .context = &b},
            {.name = "checking", .run = check_work, .context = &b}};
        for (size_t i = 0; i < 3; i++)
            assert_true(failing_each(&works[i]) > 10);
        unlink(b.from);
    }
}

static void every_failure_while_looking_through_a_cut_bag_is_told(void **state)
{
    struct bag b = {.chunk_size = 300, .compression = BAG_ZSTD, .cut = true};

    make(*state, &b);
    const struct failing_work work = {
        .name = "sorting", .run = catalog_work, .context = &b};
    assert_true(failing_each(&work) > 10);
    unlink(b.from);
}

/* -- what is copied
 * ----------------------------------------------------------------------
 */

/* That a bag could not be read for want of memory is no loss of what is in it. */
static int recover_work(void *context, struct error *why)
{
    struct bag *b = context;
    struct bag_recovery found;
    int err = b->closed = bag_recover(&found, b->from, b->to, NULL, why);

    if (!err)
        assert_int_equal(found.n_messages, N);
    return err;
}

static void every_failure_while_recovering_is_told(void **state)
{
    for (int i = 0; i < 6; i++) {
        struct bag b = {.chunk_size = 300,
                        .compression = (enum bag_compression)(i / 2),
                        .cut = i % 2};
        make(*state, &b);
        const struct failing_work work = {.name = "recovering",
                                          .run = recover_work,
                                          .check = check_written,
                                          .context = &b};
        assert_true(failing_each(&work) > 20);
        unlink(b.from);
    }
}

static int copy_all(struct bag_copy *c, const struct bag_catalog *catalog,
                    struct error *why)
{
    struct bag_cursor *cursor;
    struct bag_message m;
    uint16_t id;
    int err = bag_copy_add(c, catalog);

    if (err)
        return error_say(why, err, "out of memory");
    for (uint16_t old = 1; !err && old <= 2; old++)
        err = bag_copy_channel(c, 0, old, &id, why);
    if (err)
        return err;
    if (bag_cursor_create(&cursor, catalog))
        return error_say(why, -ENOMEM, "out of memory");
    while (!(err = bag_cursor_next(cursor, &m, why)) &&
           !(err = bag_copy_message(c, 0, &m, why)))
        ;
    bag_cursor_destroy(cursor);
    return err == -ENODATA ? bag_copy_rest(c, 0, why) : err;
}

static int copy_into(struct bag_writer *w, const struct bag_catalog *catalog,
                     struct error *why)
{
    struct bag_copy *c;

    if (bag_copy_create(&c, w))
        return error_say(why, -ENOMEM, "out of memory");
    int err = copy_all(c, catalog, why);
    bag_copy_destroy(c);
    return err;
}

static int copy_work(void *context, struct error *why)
{
    struct bag *b = context;
    const struct bag_writer_config cfg = {
        .chunk_size = 300, .profile = "", .library = ""};
    struct bag_catalog *catalog;
    struct bag_writer *w;
    int err = b->closed = bag_catalog_open(&catalog, b->from, why);

    if (err)
        return err;
    err = b->closed = bag_writer_create(&w, b->to, &cfg, why);
    if (!err)
        err = finish(b, w, copy_into(w, catalog, why), why);
    bag_catalog_close(catalog);
    return err;
}

static void every_failure_while_copying_is_told(void **state)
{
    struct bag b = {.chunk_size = 300, .compression = BAG_LZ4};

    make(*state, &b);
    const struct failing_work work = {
        .name = "copying", .run = copy_work, .check = check_written, .context = &b};
    assert_true(failing_each(&work) > 20);
    unlink(b.from);
}

/* -- messages of the bus
 * -----------------------------------------------------------------
 */

enum { N_TOPICS = 6 };

static int put_topics(struct bag_writer *w, struct error *why)
{
    struct envelope e = {.node = "dsp", .epoch_ns = 5, .payload_size = 3};
    struct bag_topics *t;
    int err = 0;

    if (bag_topics_create(&t, w))
        return error_say(why, -ENOMEM, "out of memory");
    for (unsigned i = 0; !err && i < N_TOPICS; i++) {
        snprintf(e.topic, sizeof e.topic, "%s", topics_all()[i % 3].name);
        e.capture_ns = i < 3 ? 0 : 7;
        e.sequence = i;
        err = bag_topics_put(t, &e, "abc", NULL, why);
    }
    bag_topics_destroy(t);
    return err;
}

static int topics_work(void *context, struct error *why)
{
    struct bag *b = context;
    const struct bag_writer_config cfg = {
        .chunk_size = 300, .profile = "", .library = ""};
    struct bag_writer *w;
    int err = b->closed = bag_writer_create(&w, b->to, &cfg, why);

    return err ? err : finish(b, w, put_topics(w, why), why);
}

static size_t count_messages(const char *path)
{
    struct error why = {""};
    struct bag_record record;
    struct bag_reader *r;
    size_t n = 0;

    if (bag_reader_open(&r, path, &why))
        fail_msg("%s", why.text);
    while (!bag_reader_next(r, &record, &why))
        n += record.opcode == BAG_MESSAGE;
    bag_reader_close(r);
    return n;
}

static void check_topics(void *context, int err)
{
    const struct bag *b = context;
    const struct bag_check_watch watch = {.fault = tell_fault};
    struct error why = {""};
    uint64_t faults = 0;

    if (!b->closed && (bag_check(&faults, b->to, &watch, &why) || faults))
        fail_msg("%zu faults, %s", (size_t)faults, why.text);
    if (!err)
        assert_int_equal(count_messages(b->to), N_TOPICS);
    unlink(b->to);
}

static void every_failure_while_recording_topics_is_told(void **state)
{
    struct bag b = {.chunk_size = 0};

    snprintf(b.to, sizeof b.to, "%s", scratch_path(*state, "to.mcap"));
    const struct failing_work work = {.name = "recording topics",
                                      .run = topics_work,
                                      .check = check_topics,
                                      .context = &b};
    assert_true(failing_each(&work) > 20);
}

/* -- the chunk indexes of a long bag, which wait beside it
 * -----------------------------------------------------------------
 */

enum { INDEX_BYTES = 80000, HEAD_BYTES = 13 /* the end of the data */ };

static void add_indexes(struct bag_summary *s, size_t from, size_t n)
{
    for (size_t i = from; i < from + n; i++)
        bytes_put_number(&s->chunk_indexes, i % 251, 1);
}

/* Laid down twice, and some more that stays in memory. */
static int summary_work(void *context, struct error *why)
{
    const struct bag *b = context;
    struct bag_summary s = {.fd = -1};
    struct bytes_buffer out = {0};
    size_t all = 2 * INDEX_BYTES + 100;

    for (size_t i = 0; i < 2; i++) {
        add_indexes(&s, i * INDEX_BYTES, INDEX_BYTES);
        bag_summary_lay_down(&s, b->to);
    }
    add_indexes(&s, 2 * INDEX_BYTES, 100);
    int err = bag_summary_put(&out, &s, false, 0, 0);
    if (!err && (out.failed || s.chunk_indexes.failed))
        err = -ENOMEM;
    if (!err) {
        assert_in_range(out.size, HEAD_BYTES + all, bag_summary_size(&s));
        for (size_t i = 0; i < all; i++)
            if (out.data[HEAD_BYTES + i] != i % 251)
                fail_msg("byte %zu of the indexes is %u", i, out.data[HEAD_BYTES + i]);
    }
    bytes_free(&out);
    bag_summary_free(&s);
    return err ? error_say(why, err, "the summary: %s", strerror(-err)) : 0;
}

/* What cannot be laid down stays in memory; what cannot be taken up again is told. */
static void
every_failure_while_indexes_wait_beside_a_bag_is_told_or_made_good(void **state)
{
    struct bag b = {.chunk_size = 0};

    snprintf(b.to, sizeof b.to, "%s", scratch_path(*state, "to.mcap"));
    const struct failing_work work = {
        .name = "indexes beside a bag", .run = summary_work, .context = &b};
    assert_true(failing_each(&work) > 5);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, scratch_open, scratch_close)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(every_failure_while_writing_is_told),
        TEST(every_failure_while_reading_is_told),
        TEST(every_failure_while_looking_through_a_cut_bag_is_told),
        TEST(every_failure_while_recovering_is_told),
        TEST(every_failure_while_copying_is_told),
        TEST(every_failure_while_recording_topics_is_told),
        TEST(every_failure_while_indexes_wait_beside_a_bag_is_told_or_made_good),
    };
    return cmocka_run_group_tests(tests, scratch_in_memory, NULL);
}
