/* SPDX-License-Identifier: MIT */
#include "bag_rig.h"

#include <errno.h>
#include <unistd.h>

#include "msgs/bag/recover.h"

#define N 12 /* messages, two or three to a chunk */

static uint8_t image[1 << 16]; /* of a bag */
static size_t image_size;
static char of_topic[N][8]; /* of each message that was saved last */

static void make_image(struct scratch *s, enum bag_compression compression)
{
    struct bag_writer *w = start(scratch_path(s, "whole.mcap"), 300, compression);
    struct error why = {""};

    for (size_t i = 0; i < N; i++)
        put(w, i);
    assert_int_equal(bag_writer_close(w, &why), 0);
    FILE *f = fopen(s->path, "rb");
    image_size = fread(image, 1, sizeof image, f);
    fclose(f);
    unlink(s->path);
}

static void save_image(struct scratch *s, const char *name, size_t size)
{
    FILE *f = fopen(scratch_path(s, name), "wb");

    assert_int_equal(fwrite(image, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

/* Recovers what was saved; says which messages came out right. */
static struct bag_recovery recover(struct scratch *s, bool right[N])
{
    char from[512], to[512];
    struct bag_recovery found;
    struct bag_reader *r;
    struct bag_record record;
    struct error why = {""};
    char topics[5][8] = {""}; /* by the channel's id */
    int err;

    snprintf(from, sizeof from, "%s", scratch_path(s, "hurt.mcap"));
    snprintf(to, sizeof to, "%s", scratch_path(s, "saved.mcap"));
    if (bag_recover(&found, from, to, NULL, &why))
        fail_msg("%s", why.text);
    memset(right, 0, N * sizeof *right);
    assert_int_equal(bag_reader_open(&r, to, &why), 0);
    while (!(err = bag_reader_next(r, &record, &why))) {
        char text[200];
        const struct bag_message *m = &record.message;
        if (record.opcode == BAG_MESSAGE && m->sequence < N &&
            bytes_equal(m->data, content(m->sequence, text)))
            right[m->sequence] = true;
        if (record.opcode == BAG_MESSAGE && m->sequence < N && m->channel_id < 5)
            snprintf(of_topic[m->sequence], 8, "%s", topics[m->channel_id]);
        if (record.opcode == BAG_CHANNEL) {
            struct bytes topic = record.channel.topic;
            assert_true(bytes_equal(topic, bytes_of("odd")) ||
                        bytes_equal(topic, bytes_of("even")));
            assert_in_range(record.channel.id, 1, 4);
            snprintf(topics[record.channel.id], 8, "%.*s", (int)topic.size,
                     (const char *)topic.data);
        }
    }
    if (err != -ENODATA)
        fail_msg("%s", why.text);
    bag_reader_close(r);
    unlink(from);
    unlink(to);
    return found;
}

/* Where message i ends in the image, which is not compressed. */
static size_t end_of(size_t i)
{
    char text[200];
    struct bytes b = content(i, text);
    const uint8_t *at = memmem(image, image_size, b.data, b.size);

    assert_non_null(at);
    return (size_t)(at - image) + b.size;
}

static void of_a_whole_bag_nothing_is_lost(void **state)
{
    bool right[N];

    for (int k = BAG_NONE; k <= BAG_LZ4; k++) {
        make_image(*state, (enum bag_compression)k);
        save_image(*state, "hurt.mcap", image_size);
        struct bag_recovery found = recover(*state, right);
        assert_false(bag_recovery_is_loss(&found));
        assert_int_equal(found.n_messages, N);
        assert_int_equal(found.expected_messages, N);
        for (size_t i = 0; i < N; i++)
            assert_true(right[i]);
    }
}

static void after_any_cut_every_message_before_it_is_there(void **state)
{
    bool right[N];

    make_image(*state, BAG_NONE);
    for (size_t size = image_size - 1; size > 2; size -= 11) {
        save_image(*state, "hurt.mcap", size);
        struct bag_recovery found = recover(*state, right);
        assert_true(bag_recovery_is_loss(&found) || size >= image_size - BAG_MAGIC_SIZE);
        for (size_t i = 0; i < N; i++)
            if (right[i] != (end_of(i) <= size))
                fail_msg("cut at %zu of %zu: message %zu, which ends at %zu", size,
                         image_size, i, end_of(i));
    }
}

static void compressed_chunks_before_a_cut_are_there(void **state)
{
    bool right[N];

    for (int k = BAG_ZSTD; k <= BAG_LZ4; k++) {
        size_t last = 0;
        make_image(*state, (enum bag_compression)k);
        for (size_t size = 1; size < image_size; size += 13) {
            save_image(*state, "hurt.mcap", size);
            recover(*state, right);
            size_t n = 0;
            while (n < N && right[n])
                n++;
            for (size_t i = n; i < N; i++)
                assert_false(right[i]);
            assert_true(n >= last); /* a later cut loses no more */
            last = n;
        }
        assert_int_equal(last, N);
    }
}

/* A chunk's messages may go with it; those of all others stay. */
static void one_changed_byte_costs_one_chunk_at_most(void **state)
{
    bool right[N];

    for (int k = BAG_NONE; k <= BAG_LZ4; k++) {
        make_image(*state, (enum bag_compression)k);
        for (size_t at = 0; at < image_size; at += 23) {
            image[at] ^= 0x11;
            save_image(*state, "hurt.mcap", image_size);
            image[at] ^= 0x11;
            struct bag_recovery found = recover(*state, right);
            size_t n_wrong = 0;
            for (size_t i = 0; i < N; i++)
                n_wrong += !right[i];
            if (n_wrong > 3 || (n_wrong && !bag_recovery_is_loss(&found)))
                fail_msg("byte %zu of %zu: %zu messages lost", at, image_size, n_wrong);
        }
    }
}

static void garbage_in_the_middle_is_passed_over(void **state)
{
    bool right[N];

    make_image(*state, BAG_NONE);
    size_t at = end_of(5) - 20;
    memset(image + at, 0xa5, 40);
    save_image(*state, "hurt.mcap", image_size);
    struct bag_recovery found = recover(*state, right);
    assert_true(bag_recovery_is_loss(&found));
    assert_true(found.lost_bytes > 0);
    for (size_t i = 0; i < N; i++)
        assert_true(right[i] || (i >= 3 && i <= 8));
    assert_true(right[0] && right[N - 1]);
}

#define MESSAGE_HEAD (9 + 22) /* a message's record before its data */

/* All N messages in one chunk, which has no checksum; without statistics. */
static void make_chunk_without_checksum(struct scratch *s, bool indexed)
{
    const struct bag_writer_config cfg = {.profile = "anlos",
                                          .library = "test",
                                          .chunk_size = sizeof image,
                                          .without_message_index = !indexed,
                                          .without_statistics = true};
    const struct bag_channel channel = {.topic = bytes_of("even")};
    struct error why = {""};
    struct bag_writer *w;
    char text[200];
    uint16_t id;

    assert_int_equal(bag_writer_create(&w, scratch_path(s, "whole.mcap"), &cfg, &why), 0);
    assert_int_equal(bag_writer_channel(w, &channel, &id, &why), 0);
    for (size_t i = 0; i < N; i++) {
        const struct bag_message m = {
            .channel_id = id, .sequence = (uint32_t)i, .data = content(i, text)};
        assert_int_equal(bag_writer_message(w, &m, &why), 0);
    }
    assert_int_equal(bag_writer_close(w, &why), 0);
    FILE *f = fopen(s->path, "rb");
    image_size = fread(image, 1, sizeof image, f);
    fclose(f);
    unlink(s->path);
    size_t at = BAG_MAGIC_SIZE; /* the header, then the chunk */
    at += 9 + image[at + 1] + 256u * image[at + 2];
    assert_int_equal(image[at], BAG_CHUNK);
    memset(image + at + 9 + 24, 0, 4);
}

static size_t start_of(size_t i)
{
    char text[200];

    return end_of(i) - content(i, text).size - MESSAGE_HEAD;
}

static void messages_after_a_damaged_record_of_a_chunk_are_missed(void **state)
{
    bool right[N];

    for (int indexed = 0; indexed < 2; indexed++) {
        make_chunk_without_checksum(*state, indexed);
        size_t lost = end_of(N - 1) - start_of(N - 5);
        image[start_of(N - 5) + 5] = 0xff; /* 1 TB long */
        save_image(*state, "hurt.mcap", image_size);
        struct bag_recovery found = recover(*state, right);
        for (size_t i = 0; i < N; i++)
            assert_int_equal(right[i], i < N - 5);
        assert_true(bag_recovery_is_loss(&found));
        assert_int_equal(found.n_messages, N - 5);
        assert_int_equal(found.n_damages, 1);
        assert_int_equal(found.lost_bytes, lost);
        assert_int_equal(bag_recovery_known(&found), indexed ? N : 0);
    }
}

static void a_record_of_no_kind_in_a_chunk_is_missed(void **state)
{
    static const uint8_t kinds[] = {0x85, BAG_FOOTER, 0};
    bool right[N];

    for (size_t k = 0; k < sizeof kinds; k++) {
        make_chunk_without_checksum(*state, false);
        image[start_of(4)] = kinds[k];
        save_image(*state, "hurt.mcap", image_size);
        struct bag_recovery found = recover(*state, right);
        for (size_t i = 0; i < N; i++)
            assert_int_equal(right[i], i != 4);
        assert_true(bag_recovery_is_loss(&found));
    }
}

static void put_message(struct bytes_buffer *b, size_t i)
{
    char text[200];
    struct bag_record r = {.opcode = BAG_MESSAGE};

    r.message.channel_id = 7;
    r.message.sequence = (uint32_t)i;
    r.message.data = content(i, text);
    bag_record_put(b, &r);
}

static void put_definition(struct bytes_buffer *b, uint8_t opcode, const char *name)
{
    struct bag_record r = {.opcode = opcode};

    if (opcode == BAG_SCHEMA) {
        r.schema.id = 9;
        r.schema.name = bytes_of(name);
    } else {
        r.channel.id = 7;
        r.channel.schema_id = 9;
        r.channel.topic = bytes_of(name);
    }
    bag_record_put(b, &r);
}

/* Two topics under the id 7, and two schemas under 9. */
static void of_channels_that_share_an_id_each_is_kept_and_it_is_told(void **state)
{
    static const char *const topics[] = {"even", "odd", "odd", "even"};
    struct bytes_buffer b = {0};
    struct bag_record header = {.opcode = BAG_HEADER}, end = {.opcode = BAG_DATA_END},
                      footer = {.opcode = BAG_FOOTER};
    bool right[N];

    bytes_put(&b, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
    bag_record_put(&b, &header);
    for (size_t i = 0; i < 4; i++) {
        put_definition(&b, BAG_SCHEMA, i < 2 ? "first" : "second");
        put_definition(&b, BAG_CHANNEL, topics[i]);
        put_message(&b, i);
    }
    bag_record_put(&b, &end);
    bag_record_put(&b, &footer);
    bytes_put(&b, (struct bytes){(const uint8_t *)BAG_MAGIC, BAG_MAGIC_SIZE});
    assert_true(b.size < sizeof image);
    memcpy(image, b.data, b.size);
    save_image(*state, "hurt.mcap", b.size);
    bytes_free(&b);
    struct bag_recovery found = recover(*state, right);
    assert_int_equal(found.n_messages, 4);
    assert_int_equal(found.n_redefined, 3); /* to odd, to the second, to even */
    assert_true(bag_recovery_is_loss(&found));
    for (size_t i = 0; i < 4; i++) {
        assert_true(right[i]);
        assert_string_equal(of_topic[i], topics[i]);
    }
}

static void noise_ends(void **state)
{
    struct scratch *s = *state;
    bool right[N];
    uint32_t x = 1;

    image_size = sizeof image;
    for (size_t i = 0; i < image_size; i++) {
        x = x * 1664525u + 1013904223u;
        image[i] = (uint8_t)(x >> 24) & 0x0f; /* much that looks like an opcode */
    }
    save_image(s, "hurt.mcap", image_size);
    struct bag_recovery found = recover(s, right);
    assert_true(bag_recovery_is_loss(&found));
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(of_a_whole_bag_nothing_is_lost),
        TEST(after_any_cut_every_message_before_it_is_there),
        TEST(compressed_chunks_before_a_cut_are_there),
        TEST(one_changed_byte_costs_one_chunk_at_most),
        TEST(garbage_in_the_middle_is_passed_over),
        TEST(messages_after_a_damaged_record_of_a_chunk_are_missed),
        TEST(a_record_of_no_kind_in_a_chunk_is_missed),
        TEST(of_channels_that_share_an_id_each_is_kept_and_it_is_told),
        TEST(noise_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
