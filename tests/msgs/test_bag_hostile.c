/* SPDX-License-Identifier: MIT */
/* Bags that were made to do harm: refused with an error, in bounded time and memory, by
 * everything that reads bags. */
#include <errno.h>
#include <unistd.h>
#include <zstd.h>

#include "bag_rig.h"

#include "msgs/bag/check.h"
#include "msgs/bag/cursor.h"
#include "msgs/bag/file.h"
#include "msgs/bag/recover.h"

static const struct bytes magic = {(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE};

static struct bytes_buffer begin(void)
{
    struct bytes_buffer b = {0};

    bytes_put(&b, magic);
    bag_record_put(&b, &(struct bag_record){.opcode = BAG_HEADER});
    return b;
}

/* The end without a summary, or with one that begins at summary_start. */
static void finish(struct bytes_buffer *b, uint64_t summary_start)
{
    struct bag_record footer = {.opcode = BAG_FOOTER};

    footer.footer.summary_start = summary_start;
    bag_record_put(b, &footer);
    bytes_put(b, magic);
}

static void put_data_end(struct bytes_buffer *b)
{
    bag_record_put(b, &(struct bag_record){.opcode = BAG_DATA_END});
}

/* What reads bags, and with what error each ended. */
struct verdict {
    int reader, catalog, cursor;
    uint64_t n_faults;
    struct bag_recovery recovery;
};

static int read_through(const char *path)
{
    struct error why = {""};
    struct bag_reader *r;
    struct bag_record record;
    int err = bag_reader_open(&r, path, &why);

    assert_int_equal(err, 0);
    while (!(err = bag_reader_next(r, &record, &why)))
        ;
    bag_reader_close(r);
    return err;
}

static void index_through(const char *path, struct verdict *v)
{
    struct error why = {""};
    struct bag_catalog *catalog;
    struct bag_cursor *c;
    struct bag_message m;

    v->catalog = bag_catalog_open(&catalog, path, &why);
    if (v->catalog)
        return;
    assert_int_equal(bag_cursor_create(&c, catalog), 0);
    while (!(v->cursor = bag_cursor_next(c, &m, &why)))
        ;
    bag_cursor_destroy(c);
    bag_catalog_close(catalog);
}

/* Frees b. */
static struct verdict judge(struct scratch *s, struct bytes_buffer *b)
{
    struct verdict v = {.cursor = 0};
    struct error why = {""};
    char path[600], saved[600];

    snprintf(path, sizeof path, "%s", scratch_path(s, "hostile.mcap"));
    snprintf(saved, sizeof saved, "%s", scratch_path(s, "saved.mcap"));
    FILE *f = fopen(path, "wb");
    assert_false(b->failed);
    assert_int_equal(fwrite(b->data, 1, b->size, f), b->size);
    assert_int_equal(fclose(f), 0);
    bytes_free(b);
    v.reader = read_through(path);
    index_through(path, &v);
    if (bag_check(&v.n_faults, path, NULL, &why))
        fail_msg("%s", why.text);
    if (bag_recover(&v.recovery, path, saved, NULL, &why))
        fail_msg("%s", why.text);
    assert_int_equal(read_through(saved), -ENODATA);
    unlink(saved);
    return v;
}

static void put_channel(struct bytes_buffer *b)
{
    struct bag_record r = {.opcode = BAG_CHANNEL};

    r.channel.id = 1;
    r.channel.topic = bytes_of("t");
    bag_record_put(b, &r);
}

static void put_message(struct bytes_buffer *b)
{
    struct bag_record r = {.opcode = BAG_MESSAGE};

    r.message.channel_id = 1;
    bag_record_put(b, &r);
}

/* Every field of a record that is a length, in turn, says more than there is. */
static void lengths_of_2_to_the_63_are_refused(void **state)
{
    static const uint64_t lengths[] = {(uint64_t)1 << 63, UINT64_MAX, UINT64_MAX - 8,
                                       (uint64_t)1 << 62, (uint64_t)1 << 32};

    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        for (uint8_t opcode = BAG_SCHEMA; opcode <= BAG_METADATA; opcode++) {
            struct bytes_buffer b = begin();
            put_channel(&b);
            put_message(&b);
            bytes_put_number(&b, opcode, 1);
            bytes_put_number(&b, lengths[i], 8);
            for (int k = 0; k < 40; k++)
                bytes_put_number(&b, UINT64_MAX, 8);
            put_data_end(&b);
            finish(&b, 0);
            struct verdict v = judge(*state, &b);
            assert_int_equal(v.reader, -EBADMSG);
            assert_int_equal(v.catalog, -EBADMSG);
            assert_true(v.n_faults > 0);
            assert_int_equal(v.recovery.n_messages, 1); /* before the damage */
            assert_true(bag_recovery_is_loss(&v.recovery));
        }
    }
}

static void lengths_inside_of_records_are_refused(void **state)
{
    for (uint8_t opcode = BAG_SCHEMA; opcode <= BAG_METADATA; opcode++) {
        struct bytes_buffer b = begin();
        if (opcode == BAG_MESSAGE || opcode == BAG_CHUNK_INDEX ||
            opcode == BAG_ATTACHMENT_INDEX)
            goto next; /* no lengths, or not of this section */
        bytes_put_number(&b, opcode, 1);
        bytes_put_number(&b, 160, 8);
        for (int k = 0; k < 20; k++)
            bytes_put_number(&b, (uint64_t)0x80000000 << 32 | 0x80000000, 8);
        put_data_end(&b);
        finish(&b, 0);
        struct verdict v = judge(*state, &b);
        assert_int_equal(v.reader, -EBADMSG);
        assert_int_equal(v.catalog, -EBADMSG);
        assert_true(v.n_faults > 0);
    next:
        bytes_free(&b);
    }
}

/* A chunk of one record of n bytes that no one knows. */
static void put_bomb(struct bytes_buffer *b, size_t n, uint64_t claimed)
{
    struct bag_record chunk = {.opcode = BAG_CHUNK};
    uint8_t *plain = calloc(1, n), *packed = malloc(ZSTD_compressBound(n));

    plain[0] = 0x80;
    for (int i = 0; i < 8; i++)
        plain[1 + i] = (uint8_t)((n - 9) >> 8 * i);
    chunk.chunk.compression = bytes_of("zstd");
    chunk.chunk.uncompressed_size = claimed;
    chunk.chunk.records =
        (struct bytes){packed, ZSTD_compress(packed, ZSTD_compressBound(n), plain, n, 1)};
    bag_record_put(b, &chunk);
    free(plain);
    free(packed);
}

static void a_chunk_that_claims_to_be_huge_is_refused(void **state)
{
    static const uint64_t claims[] = {(uint64_t)1 << 63, UINT64_MAX, BAG_MAX_SIZE + 1};

    for (size_t i = 0; i < sizeof claims / sizeof *claims; i++) {
        struct bytes_buffer b = begin();
        put_bomb(&b, 1 << 20, claims[i]);
        put_data_end(&b);
        finish(&b, 0);
        struct verdict v = judge(*state, &b);
        assert_int_equal(v.reader, -EFBIG);
        assert_int_equal(v.catalog, -EFBIG);
        assert_true(v.n_faults > 0);
        assert_true(bag_recovery_is_loss(&v.recovery));
    }
}

static void a_chunk_that_grows_beyond_its_claim_is_refused(void **state)
{
    struct bytes_buffer b = begin();

    put_bomb(&b, 32 << 20, 100);
    put_data_end(&b);
    finish(&b, 0);
    struct verdict v = judge(*state, &b);
    assert_int_equal(v.reader, -EBADMSG);
    assert_int_equal(v.catalog, -EBADMSG);
    assert_true(v.n_faults > 0);
}

/* Each of them is small enough, all together would be 5 GB out of 200 kB. */
static void many_bombs_are_refused_before_all_have_gone_off(void **state)
{
    const size_t n = 200 << 20;
    struct bytes_buffer b = begin(), bomb = {0};

    put_bomb(&bomb, n, n);
    for (int i = 0; i < 25; i++)
        bytes_put(&b, bytes_in(&bomb));
    put_data_end(&b);
    finish(&b, 0);
    assert_true(b.size < 400000);
    bytes_free(&bomb);
    struct verdict v = judge(*state, &b);
    assert_int_equal(v.reader, -EFBIG);
    assert_int_equal(v.catalog, -EFBIG);
    assert_true(v.n_faults > 0);
    assert_true(bag_recovery_is_loss(&v.recovery));
}

static void a_chunk_in_a_chunk_is_refused(void **state)
{
    struct bytes_buffer b = begin(), inner = {0}, outer = {0};
    struct bag_record chunk = {.opcode = BAG_CHUNK};

    bag_record_put(&inner, &chunk);
    for (int depth = 0; depth < 50; depth++) {
        outer.size = 0;
        chunk.chunk.records = bytes_in(&inner);
        chunk.chunk.uncompressed_size = inner.size;
        bag_record_put(&outer, &chunk);
        inner.size = 0;
        bytes_put(&inner, bytes_in(&outer));
    }
    bytes_put(&b, bytes_in(&inner));
    put_data_end(&b);
    finish(&b, 0);
    bytes_free(&inner);
    bytes_free(&outer);
    struct verdict v = judge(*state, &b);
    assert_int_equal(v.reader, -EBADMSG);
    assert_true(v.n_faults > 0);
}

/* A bag of one chunk whose summary has `copies` indexes of it, at an offset of its own.
 */
static void put_indexed_at(struct bytes_buffer *b, int copies, uint64_t moved,
                           uint64_t time)
{
    struct bag_record chunk = {.opcode = BAG_CHUNK}, index = {.opcode = BAG_CHUNK_INDEX};
    struct bag_record statistics = {.opcode = BAG_STATISTICS};
    struct bytes_buffer records = {0};
    uint64_t offset = b->size;

    put_channel(&records);
    put_message(&records);
    chunk.chunk.records = bytes_in(&records);
    chunk.chunk.uncompressed_size = records.size;
    bag_record_put(b, &chunk);
    uint64_t length = b->size - offset;
    put_data_end(b);
    uint64_t summary = b->size;
    index.chunk_index.chunk_start_offset = offset + moved;
    index.chunk_index.chunk_length = length;
    index.chunk_index.message_start_time = time;
    index.chunk_index.message_end_time = time;
    index.chunk_index.compressed_size = records.size;
    index.chunk_index.uncompressed_size = records.size;
    statistics.statistics.message_count = (uint64_t)copies;
    statistics.statistics.chunk_count = (uint32_t)copies;
    statistics.statistics.channel_count = 1;
    put_channel(b);
    bag_record_put(b, &statistics);
    for (int i = 0; i < copies; i++)
        bag_record_put(b, &index);
    finish(b, summary);
    bytes_free(&records);
}

static void put_indexed(struct bytes_buffer *b, int copies, uint64_t moved)
{
    put_indexed_at(b, copies, moved, 0);
}

/* The message would come at another time than its place in the order says. */
static void an_index_with_wrong_times_is_refused(void **state)
{
    struct bytes_buffer b = begin();

    put_indexed_at(&b, 1, 0, 5);
    struct verdict v = judge(*state, &b);
    assert_int_equal(v.catalog, 0);
    assert_int_equal(v.cursor, -EBADMSG);
    assert_true(v.n_faults > 0);
}

static void a_chunk_that_is_indexed_many_times_is_refused(void **state)
{
    struct bytes_buffer b = begin();

    put_indexed(&b, 1, 0);
    struct verdict v = judge(*state, &b);
    assert_int_equal(v.catalog, 0);
    assert_int_equal(v.cursor, -ENODATA);
    assert_int_equal(v.n_faults, 0);
    b = begin();
    put_indexed(&b, 1000, 0);
    v = judge(*state, &b);
    assert_int_equal(v.catalog, -EBADMSG);
    assert_true(v.n_faults > 0);
}

static void an_index_that_points_elsewhere_is_refused(void **state)
{
    static const uint64_t moves[] = {1, 9, 40, UINT64_MAX - 30, UINT64_MAX, 1u << 31};

    for (size_t i = 0; i < sizeof moves / sizeof *moves; i++) {
        struct bytes_buffer b = begin();
        put_indexed(&b, 1, moves[i]);
        struct verdict v = judge(*state, &b);
        int err = v.catalog ? v.catalog : v.cursor;
        assert_true(err == -EBADMSG || err == -EFBIG);
        assert_true(v.n_faults > 0);
        assert_int_equal(v.recovery.n_messages, 1);
    }
}

static void an_attachment_that_is_indexed_many_times_is_refused(void **state)
{
    struct bag_record a = {.opcode = BAG_ATTACHMENT};
    struct bag_record index = {.opcode = BAG_ATTACHMENT_INDEX};
    struct bag_record statistics = {.opcode = BAG_STATISTICS};
    struct bytes_buffer b = begin();

    index.attachment_index.offset = b.size;
    bag_record_put(&b, &a);
    index.attachment_index.length = b.size - index.attachment_index.offset;
    put_data_end(&b);
    uint64_t summary = b.size;
    statistics.statistics.attachment_count = 1000;
    bag_record_put(&b, &statistics);
    for (int i = 0; i < 1000; i++)
        bag_record_put(&b, &index);
    finish(&b, summary);
    struct verdict v = judge(*state, &b);
    assert_int_equal(v.catalog, -EBADMSG);
    assert_true(v.n_faults > 0);
}

/* The summary of a footer that names any byte of the file, itself among them. */
static void a_summary_that_begins_anywhere_ends(void **state)
{
    struct bytes_buffer whole = begin();

    put_indexed(&whole, 1, 0);
    size_t size = whole.size;
    bytes_free(&whole);
    for (uint64_t start = 1; start < size + 3; start += 3) {
        struct bytes_buffer b = begin();
        put_indexed(&b, 1, 0);
        bytes_set_number(&b, size - BAG_MAGIC_SIZE - 20, start, 8);
        struct verdict v = judge(*state, &b);
        assert_true(v.reader == -EBADMSG || v.reader == -ENODATA);
        /* It is found by a look through the whole file, or the summary was right. */
        assert_int_equal(v.catalog, 0);
        assert_int_equal(v.cursor, -ENODATA);
        assert_true((v.reader == -ENODATA) == !v.n_faults);
    }
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(lengths_of_2_to_the_63_are_refused),
        TEST(lengths_inside_of_records_are_refused),
        TEST(a_chunk_that_claims_to_be_huge_is_refused),
        TEST(a_chunk_that_grows_beyond_its_claim_is_refused),
        TEST(many_bombs_are_refused_before_all_have_gone_off),
        TEST(a_chunk_in_a_chunk_is_refused),
        TEST(an_index_with_wrong_times_is_refused),
        TEST(a_chunk_that_is_indexed_many_times_is_refused),
        TEST(an_index_that_points_elsewhere_is_refused),
        TEST(an_attachment_that_is_indexed_many_times_is_refused),
        TEST(a_summary_that_begins_anywhere_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
