/* SPDX-License-Identifier: MIT */
#include "bag_rig.h"

#include <errno.h>
#include <inttypes.h>
#include <unistd.h>

#include "msgs/bag/check.h"

static uint8_t image[1 << 16]; /* of a bag */
static size_t image_size;

static void make_image(struct scratch *s, size_t chunk_size)
{
    struct bag_writer *w = start(scratch_path(s, "whole.mcap"), chunk_size, BAG_NONE);
    struct bytes_buffer map = {0};
    struct error why = {""};

    bag_map_put(&map, bytes_of("revision"), bytes_of("3b8b81f"));
    assert_int_equal(bag_writer_attachment(
                         w,
                         &(struct bag_attachment){.name = bytes_of("survey.yaml"),
                                                  .media_type = bytes_of("text/plain"),
                                                  .data = bytes_of("speakers: none")},
                         &why),
                     0);
    assert_int_equal(
        bag_writer_metadata(
            w,
            &(struct bag_metadata){.name = bytes_of("build"), .metadata = bytes_in(&map)},
            &why),
        0);
    bytes_free(&map);
    for (size_t i = 0; i < 6; i++)
        put(w, i);
    assert_int_equal(bag_writer_close(w, &why), 0);
    FILE *f = fopen(s->path, "rb");
    image_size = fread(image, 1, sizeof image, f);
    fclose(f);
    unlink(s->path);
}

struct faults {
    uint64_t n, offset; /* of the first */
    char text[256];
};

static void note(void *context, uint64_t offset, const char *what)
{
    struct faults *f = context;

    if (!f->n++) {
        f->offset = offset;
        snprintf(f->text, sizeof f->text, "%s", what);
    }
}

static struct faults check_image(struct scratch *s)
{
    struct faults found = {0};
    const struct bag_check_watch watch = {.fault = note, .context = &found};
    struct error why = {""};
    uint64_t n;
    FILE *f = fopen(scratch_path(s, "checked.mcap"), "wb");

    assert_int_equal(fwrite(image, 1, image_size, f), image_size);
    assert_int_equal(fclose(f), 0);
    if (bag_check(&n, s->path, &watch, &why))
        fail_msg("%s", why.text);
    assert_int_equal(n, found.n);
    return found;
}

static void a_whole_bag_has_no_fault(void **state)
{
    for (size_t chunk_size = 0; chunk_size < 1000; chunk_size += 300) {
        make_image(*state, chunk_size);
        struct faults found = check_image(*state);
        if (found.n)
            fail_msg("byte %" PRIu64 ": %s", found.offset, found.text);
    }
}

static void every_changed_byte_is_found(void **state)
{
    make_image(*state, 300);
    for (size_t at = BAG_MAGIC_SIZE; at < image_size; at++) {
        image[at] ^= 0x21;
        struct faults found = check_image(*state);
        image[at] ^= 0x21;
        if (!found.n || found.offset > image_size)
            fail_msg("byte %zu of %zu: %s", at, image_size, found.text);
    }
}

/* Sets the checksums of both sections right, as somebody would who changed a byte on
 * purpose: then only the contents tell. */
static void seal(void)
{
    size_t at = BAG_MAGIC_SIZE;
    uint32_t crc = bag_crc(0, (struct bytes){image, BAG_MAGIC_SIZE});

    while (at < image_size - BAG_MAGIC_SIZE) {
        struct bytes_cursor c = {.left = {image + at, image_size - at}};
        uint8_t opcode = image[at];
        bytes_number(&c, 1);
        size_t size = 9 + (size_t)bytes_number(&c, 8);
        if (opcode == BAG_DATA_END || opcode == BAG_FOOTER) {
            size_t covered = opcode == BAG_FOOTER ? size - 4 : 0;
            uint32_t sum = bag_crc(crc, (struct bytes){image + at, covered});
            for (int i = 0; i < 4; i++)
                image[at + size - 4 + (size_t)i] = (uint8_t)(sum >> 8 * i);
            crc = 0;
        } else {
            crc = bag_crc(crc, (struct bytes){image + at, size});
        }
        at += size;
    }
}

static size_t find_record(uint8_t opcode, size_t nth)
{
    size_t at = BAG_MAGIC_SIZE;

    for (;;) {
        struct bytes_cursor c = {.left = {image + at, image_size - at}};
        assert_true(at < image_size);
        if (image[at] == opcode && !nth--)
            return at;
        bytes_number(&c, 1);
        at += 9 + (size_t)bytes_number(&c, 8);
    }
}

/* Changes a byte of the content of the first record of a kind; what is said of it. */
static void expect(struct scratch *s, uint8_t opcode, size_t in_content, const char *what)
{
    make_image(s, 300);
    image[find_record(opcode, 0) + BAG_RECORD_HEAD_SIZE + in_content] ^= 0x01;
    seal();
    struct faults found = check_image(s);
    if (!found.n || !strstr(found.text, what))
        fail_msg("\"%s\" does not contain \"%s\"", found.text, what);
}

static void what_does_not_match_its_index_is_named(void **state)
{
    expect(*state, BAG_MESSAGE_INDEX, 6, "does not match its");
    expect(*state, BAG_MESSAGE_INDEX, 0, "does not match its");
    expect(*state, BAG_CHUNK_INDEX, 0, "chunk index does not match");
    expect(*state, BAG_CHUNK_INDEX, 16, "where there is no such thing");
    expect(*state, BAG_ATTACHMENT_INDEX, 16, "attachment index does not match");
    expect(*state, BAG_METADATA_INDEX, 8, "metadata index does not match");
    expect(*state, BAG_STATISTICS, 0, "for the messages, but it is 6");
    expect(*state, BAG_STATISTICS, 10, "for the channels, but it is 2");
    expect(*state, BAG_STATISTICS, 26, "for the first time");
    expect(*state, BAG_SUMMARY_OFFSET, 9, "summary offset does not match");
    expect(*state, BAG_FOOTER, 0, "beginning of the summary");
    expect(*state, BAG_CHUNK, 0, "outside of the chunk's times");
}

static void a_schema_that_changes_is_noticed(void **state)
{
    struct faults found;

    make_image(*state, 300); /* the schemas of chunks are under their checksum */
    image[find_record(BAG_SCHEMA, 0) + BAG_RECORD_HEAD_SIZE + 6] ^= 0x01;
    seal();
    found = check_image(*state);
    assert_contains(found.text, "schema 1 is not what it was before");
}

static void a_cut_bag_says_where_it_ends(void **state)
{
    make_image(*state, 300);
    size_t begin = find_record(BAG_CHUNK, 1);
    image_size = begin + 20;
    struct faults found = check_image(*state);
    assert_int_equal(found.n, 1);
    assert_int_equal(found.offset, begin);
    assert_contains(found.text, "ends in the middle of a record");
}

static bool stop(void)
{
    return true;
}

static void it_can_be_stopped_and_says_how_far_it_came(void **state)
{
    struct scratch *s = *state;
    const struct bag_check_watch watch = {.stop = stop};
    struct error why = {""};
    uint64_t n;

    make_image(s, 300);
    check_image(s);
    assert_int_equal(bag_check(&n, s->path, &watch, &why), -EINTR);
    assert_int_equal(n, 0);
    assert_contains(why.text, "checked.mcap: interrupted after 0.0 of 0.0 MB, 0 faults");
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(a_whole_bag_has_no_fault),
        TEST(every_changed_byte_is_found),
        TEST(what_does_not_match_its_index_is_named),
        TEST(a_schema_that_changes_is_noticed),
        TEST(a_cut_bag_says_where_it_ends),
        TEST(it_can_be_stopped_and_says_how_far_it_came),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
