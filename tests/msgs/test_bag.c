/* SPDX-License-Identifier: MIT */
#include "bag_rig.h"

#include <errno.h>
#include <inttypes.h>
#include <malloc.h>
#include <unistd.h>

#include "msgs/bag/check.h"
#include "msgs/bag/cursor.h"

static const char *write_bag(struct scratch *s, size_t chunk_size,
                             enum bag_compression compression)
{
    struct bag_writer *w = start(scratch_path(s, "a.mcap"), chunk_size, compression);
    struct error why = {""};

    assert_int_equal(bag_writer_attachment(w,
                                           &(struct bag_attachment){
                                               .name = bytes_of("survey.yaml"),
                                               .media_type = bytes_of("application/yaml"),
                                               .data = bytes_of("speakers: none")},
                                           &why),
                     0);
    for (size_t i = 0; i < N_MESSAGES; i++)
        put(w, i);
    assert_int_equal(bag_writer_close(w, &why), 0);
    return s->path;
}

static struct bag_catalog *open_catalog(const char *path)
{
    struct error why = {""};
    struct bag_catalog *c;

    if (bag_catalog_open(&c, path, &why))
        fail_msg("%s", why.text);
    return c;
}

static void read_in_order(const char *path, uint64_t from, bool odd_only, size_t expected)
{
    struct bag_catalog *catalog = open_catalog(path);
    struct bag_cursor *c;
    struct bag_message m;
    struct error why = {""};
    uint64_t last = from;
    size_t n = 0;
    int err;

    assert_int_equal(bag_cursor_create(&c, catalog), 0);
    bag_cursor_select(c, 1, !odd_only);
    bag_cursor_seek(c, from);
    while (!(err = bag_cursor_next(c, &m, &why))) {
        check_message(&m);
        assert_true(m.log_time >= last);
        last = m.log_time;
        n++;
    }
    if (err != -ENODATA)
        fail_msg("%s", why.text);
    assert_int_equal(n, expected);
    bag_cursor_destroy(c);
    bag_catalog_close(catalog);
}

static void messages_come_in_the_order_of_their_times(void **state)
{
    static const size_t sizes[] = {0, 1, 700, 1 << 20};

    for (size_t i = 0; i < 4; i++) {
        for (int k = BAG_NONE; k <= BAG_LZ4; k++) {
            const char *path = write_bag(*state, sizes[i], (enum bag_compression)k);
            read_in_order(path, 0, false, N_MESSAGES);
            read_in_order(path, time_of(400), false, N_MESSAGES - (400 ^ 3));
            read_in_order(path, 0, true, N_MESSAGES / 2);
            read_in_order(path, UINT64_MAX, false, 0);
            unlink(path);
        }
    }
}

static void the_catalog_says_what_is_there(void **state)
{
    const char *path = write_bag(*state, 5000, BAG_ZSTD);
    struct bag_catalog *c = open_catalog(path);
    struct bytes_buffer bytes = {0};
    struct bag_record r;
    struct error why = {""};

    assert_false(c->scanned);
    assert_int_equal(c->n_messages, N_MESSAGES);
    assert_int_equal(c->start_time, 1000);
    assert_int_equal(c->end_time, 1000 + 10 * (N_MESSAGES - 1));
    assert_int_equal(c->counts[1], N_MESSAGES / 2);
    assert_true(bytes_equal(bag_catalog_channel(c, 2)->topic, bytes_of("odd")));
    assert_true(bytes_equal(bag_catalog_schema(c, 1)->name, bytes_of("text")));
    assert_null(bag_catalog_channel(c, 3));
    assert_int_equal(c->n_attachments, 1);
    assert_int_equal(bag_catalog_read(c, &c->attachments[0].record, &bytes, &r, &why), 0);
    assert_true(bytes_equal(r.attachment.data, bytes_of("speakers: none")));
    bytes_free(&bytes);
    bag_catalog_close(c);
}

static void without_a_summary_the_whole_file_is_looked_through(void **state)
{
    struct scratch *s = *state;
    struct bag_writer_config cfg = {.profile = "",
                                    .library = "",
                                    .chunk_size = 5000,
                                    .without_chunk_index = true,
                                    .without_statistics = true,
                                    .without_schemas = true,
                                    .without_channels = true,
                                    .without_attachment_index = true};
    struct error why = {""};
    struct bag_writer *w;
    uint16_t id;

    assert_int_equal(bag_writer_create(&w, scratch_path(s, "b.mcap"), &cfg, &why), 0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(bag_writer_channel(
                             w, &(struct bag_channel){.topic = bytes_of("t")}, &id, &why),
                         0);
    assert_int_equal(
        bag_writer_attachment(w, &(struct bag_attachment){.name = bytes_of("n")}, &why),
        0);
    for (size_t i = 0; i < N_MESSAGES; i++)
        put(w, i);
    assert_int_equal(bag_writer_close(w, &why), 0);
    struct bag_catalog *c = open_catalog(s->path);
    assert_true(c->scanned);
    assert_int_equal(c->n_messages, N_MESSAGES);
    assert_int_equal(c->end_time, 1000 + 10 * (N_MESSAGES - 1));
    assert_int_equal(c->n_attachments, 1);
    bag_catalog_close(c);
    read_in_order(s->path, 0, false, N_MESSAGES);
}

/* Reads to the end; the error that it ends with. */
static int read_all(const char *path, size_t *n)
{
    struct bag_reader *r;
    struct bag_record record;
    struct error why = {""};
    int err = bag_reader_open(&r, path, &why);

    *n = 0;
    if (err)
        return err;
    while (!(err = bag_reader_next(r, &record, &why)))
        if (record.opcode == BAG_MESSAGE) {
            check_message(&record.message);
            ++*n;
        }
    assert_true(err == -ENODATA || why.text[0]);
    bag_reader_close(r);
    return err;
}

static void every_cut_is_noticed_and_nothing_wrong_is_read(void **state)
{
    struct scratch *s = *state;
    struct bag_writer *w = start(scratch_path(s, "a.mcap"), 300, BAG_NONE);
    struct error why = {""};
    size_t n;

    for (size_t i = 0; i < 12; i++)
        put(w, i);
    assert_int_equal(bag_writer_close(w, &why), 0);
    assert_int_equal(read_all(s->path, &n), -ENODATA);
    assert_int_equal(n, 12);
    FILE *f = fopen(s->path, "rb");
    fseek(f, 0, SEEK_END);
    for (long size = ftell(f) - 1; size >= 0; size--) {
        assert_int_equal(truncate(s->path, size), 0);
        assert_int_equal(read_all(s->path, &n), -EBADMSG);
    }
    fclose(f);
}

static void every_changed_byte_is_noticed(void **state)
{
    struct scratch *s = *state;
    struct bag_writer *w = start(scratch_path(s, "a.mcap"), 300, BAG_LZ4);
    struct error why = {""};
    size_t n;

    for (size_t i = 0; i < 4; i++)
        put(w, i);
    assert_int_equal(bag_writer_close(w, &why), 0);
    FILE *f = fopen(s->path, "r+b");
    fseek(f, 0, SEEK_END);
    long size = ftell(f);
    for (long at = 0; at < size; at++) {
        fseek(f, at, SEEK_SET);
        int byte = fgetc(f);
        fseek(f, at, SEEK_SET);
        fputc(byte ^ 0x20, f);
        fflush(f);
        int err = read_all(s->path, &n);
        if (err != -EBADMSG && err != -ENOTSUP && err != -EFBIG)
            fail_msg("byte %ld of %ld: %d", at, size, err);
        fseek(f, at, SEEK_SET);
        fputc(byte, f);
        fflush(f);
    }
    fclose(f);
    assert_int_equal(read_all(s->path, &n), -ENODATA);
}

/* All that is in it is read; then it says that it is not the file that was written. */
static void bytes_after_the_end_are_noticed(void **state)
{
    const char *path = write_bag(*state, 700, BAG_ZSTD);
    FILE *file = fopen(path, "ab");
    struct error why = {""};
    struct bag_reader *r;
    struct bag_record record;
    size_t messages = 0;
    int err;

    assert_non_null(file);
    assert_int_equal(fputc('x', file), 'x');
    assert_int_equal(fclose(file), 0);
    assert_int_equal(bag_reader_open(&r, path, &why), 0);
    while (!(err = bag_reader_next(r, &record, &why)))
        messages += record.opcode == BAG_MESSAGE;
    assert_int_equal(err, -EBADMSG);
    assert_int_equal(messages, N_MESSAGES);
    assert_non_null(strstr(why.text, "something follows the closing magic"));
    bag_reader_close(r);
}

static void what_could_not_be_read_is_not_written(void **state)
{
    struct scratch *s = *state;
    struct bag_writer *w = start(scratch_path(s, "a.mcap"), 300, BAG_NONE);
    const struct bag_message m = {.channel_id = 1, .data = {(uint8_t *)"", BAG_MAX_SIZE}};
    const struct bag_attachment a = {.data = m.data};
    struct error why = {""};
    size_t n;

    put(w, 0);
    assert_int_equal(bag_writer_message(w, &m, &why), -EMSGSIZE);
    assert_int_equal(bag_writer_attachment(w, &a, &why), -EMSGSIZE);
    put(w, 1);
    assert_int_equal(bag_writer_close(w, &why), 0);
    assert_int_equal(read_all(s->path, &n), -ENODATA);
    assert_int_equal(n, 2);
}

static void a_file_that_is_there_is_not_written_over(void **state)
{
    struct scratch *s = *state;
    const struct bag_writer_config cfg = {.profile = "", .library = ""};
    struct error why = {""};
    struct bag_writer *w;

    scratch_write(s, "a.mcap", "mine");
    assert_int_equal(bag_writer_create(&w, s->path, &cfg, &why), -EEXIST);
    assert_non_null(strstr(why.text, "a.mcap"));
}

static void what_is_no_bag_is_refused(void **state)
{
    struct scratch *s = *state;
    struct bag_catalog *c;
    struct error why = {""};

    assert_int_equal(bag_catalog_open(&c, scratch_path(s, "none.mcap"), &why), -ENOENT);
    assert_int_equal(bag_catalog_open(&c, s->folder, &why), -EINVAL);
    scratch_write(s, "text.mcap", "");
    assert_int_equal(bag_catalog_open(&c, s->path, &why), -EBADMSG);
    scratch_write(s, "text.mcap", "this is no bag but some text");
    assert_int_equal(bag_catalog_open(&c, s->path, &why), -EBADMSG);
    assert_non_null(strstr(why.text, "no MCAP file"));
}

static size_t memory_in_use(void)
{
    struct mallinfo2 m = mallinfo2();

    return m.uordblks + m.hblkhd;
}

/* As many as ten hours have at a flush in a second: one chunk index is over 80 bytes. */
static void the_memory_of_a_writer_does_not_grow_with_the_file(void **state)
{
    enum { CHUNKS = 36000 };
    struct bag_writer *w = start(scratch_path(*state, "long.mcap"), 1, BAG_NONE);
    struct error why = {""};
    uint64_t n_faults;

    for (size_t i = 0; i < 100; i++)
        put(w, i);
    size_t before = memory_in_use();
    for (size_t i = 100; i < CHUNKS; i++)
        put(w, i);
    size_t grown = memory_in_use() - before;
    if (grown > 1 << 20 && grown < SIZE_MAX / 2)
        fail_msg("%zu bytes more for %d chunks", grown, CHUNKS - 100);
    assert_int_equal(bag_writer_close(w, &why), 0);
    const char *path = ((struct scratch *)*state)->path;
    assert_int_equal(bag_check(&n_faults, path, NULL, &why), 0);
    assert_int_equal(n_faults, 0);
    struct bag_catalog *c = open_catalog(path);
    assert_false(c->scanned);
    assert_int_equal(c->n_chunks, CHUNKS);
    bag_catalog_close(c);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(messages_come_in_the_order_of_their_times),
        TEST(the_catalog_says_what_is_there),
        TEST(without_a_summary_the_whole_file_is_looked_through),
        TEST(every_cut_is_noticed_and_nothing_wrong_is_read),
        TEST(every_changed_byte_is_noticed),
        TEST(bytes_after_the_end_are_noticed),
        TEST(what_could_not_be_read_is_not_written),
        TEST(a_file_that_is_there_is_not_written_over),
        TEST(what_is_no_bag_is_refused),
        TEST(the_memory_of_a_writer_does_not_grow_with_the_file),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
