/* SPDX-License-Identifier: MIT */
/* Bags that were made to do harm, through each verb of `anlos bag`: each ends with an
 * error and its words, or with what is there to show, within 1 GB and some seconds. */
#include "tests/fuzz/hostile_bag.h"
#include "tests/hal/folder.h"

#include <sys/resource.h>
#include <unistd.h>

#include "msgs/bag/topic_message.h"
#include "msgs/bag/writer.h"
#include "nodes/anlos/commands.h"
#include "tests/msgs/memory_limit.h"
#include "tests/nodes/command.h"

#define MB        ((size_t)1 << 20)
#define MEMORY    (1024 * MB)
#define MAX_CPU_S 20 /* of a command, with a sanitizer on a busy machine */

static char folder[64], hostile[96], sound[96], out[96];

static int make_folder(void **state)
{
    if (scratch_open(state))
        return -1;
    snprintf(folder, sizeof folder, "%s", ((struct scratch *)*state)->folder);
    snprintf(hostile, sizeof hostile, "%s/hostile.mcap", folder);
    snprintf(sound, sizeof sound, "%s/sound.mcap", folder);
    snprintf(out, sizeof out, "%s/out", folder);
    return 0;
}

/* Exit code 0, 1 or 2, and what is wrong in words. */
static int run(const char *const words[])
{
    static struct command_result r;

    command_run(&r, command_bag, (char *const *)words);
    if (r.code < 0 || r.code > 2)
        fail_msg("anlos bag %s: code %d: %.2000s", words[1], r.code, r.err);
    if (r.code && !r.err[0] && !r.out[0])
        fail_msg("anlos bag %s: code %d without a word", words[1], r.code);
    assert_int_equal(folder_remove(out), 0);
    return r.code;
}

#define bag(...) run((const char *const[]){"bag", __VA_ARGS__, NULL})

struct verdict {
    int info, check, recover, filter, merge, json, csv, nrrd, png, wav;
};

static struct verdict judge_all(void)
{
    return (struct verdict){
        .info = bag("info", hostile),
        .check = bag("check", hostile),
        .recover = bag("recover", hostile, "-o", out),
        .filter = bag("filter", hostile, "-o", out, "--end", "1000"),
        .merge = bag("merge", hostile, hostile, "-o", out),
        .json = bag("export", hostile, "--format", "json", "-o", out),
        .csv = bag("export", hostile, "--format", "csv", "-o", out),
        .nrrd = bag("export", hostile, "--format", "nrrd", "-o", out),
        .png = bag("export", hostile, "--format", "png", "-o", out),
        .wav = bag("export", hostile, "--format", "wav", "-o", out),
    };
}

/* recovers: 1, some of it; 2, nothing is whole. */
static void assert_refused_by_all(int recovers)
{
    struct verdict v = judge_all();

    assert_int_equal(v.info, 2);
    assert_int_equal(v.check, 1);
    assert_int_equal(v.recover, recovers);
    assert_int_equal(v.filter, 2);
    assert_int_equal(v.merge, 2);
    assert_int_equal(v.json, 2);
    assert_int_equal(v.csv, 2);
    assert_int_equal(v.nrrd, 2);
    assert_int_equal(v.png, 2);
    assert_int_equal(v.wav, 2);
}

static void a_record_of_2_to_the_63_bytes_is_refused(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin();

    hostile_put_channel(&b, 1, "t");
    hostile_put_message(&b, 1);
    bytes_put_number(&b, BAG_MESSAGE, 1);
    bytes_put_number(&b, (uint64_t)1 << 63, 8);
    hostile_end_data(&b);
    hostile_finish(&b, hostile, 0, 0);
    assert_refused_by_all(1);
}

static void a_chunk_that_claims_2_to_the_63_bytes_is_refused(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin(), records = {0};

    hostile_put_channel(&records, 1, "t");
    hostile_put_message(&records, 1);
    hostile_put_chunk(&b, &records, (uint64_t)1 << 63);
    hostile_end_data(&b);
    hostile_finish(&b, hostile, 0, 0);
    assert_refused_by_all(2);
}

/* Each chunk of 200 MB out of 20 kB. */
static void many_bombs_are_refused(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin(), records = {0}, bomb = {0};
    const size_t n = 200 * MB;

    bytes_put_number(&records, 0x80, 1); /* a record that nobody knows */
    bytes_put_number(&records, n, 8);
    assert_int_equal(bytes_reserve(&records, n + 9), 0);
    memset(records.data + 9, 0, n);
    records.size = n + 9;
    hostile_put_chunk(&bomb, &records, 0);
    for (int i = 0; i < 10; i++)
        bytes_put(&b, bytes_in(&bomb));
    bytes_free(&bomb);
    hostile_end_data(&b);
    assert_true(b.size < MB / 2);
    hostile_finish(&b, hostile, 0, 0);
    assert_refused_by_all(2);
}

/* 3 million messages out of some 100 kB: a bag, and shown as one. */
static void a_chunk_of_millions_of_messages_is_read_in_bounded_time(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin(), records = {0};

    hostile_put_channel(&records, 1, "t");
    for (int i = 0; i < 3000000; i++)
        hostile_put_message(&records, 5);
    hostile_put_chunk(&b, &records, 0);
    hostile_end_data(&b);
    hostile_finish(&b, hostile, 0, 0);
    assert_int_equal(bag("info", hostile), 0);
    assert_int_equal(bag("filter", hostile, "-o", out), 0);
    assert_int_equal(bag("recover", hostile, "-o", out), 0);
    assert_int_equal(bag("export", hostile, "--format", "wav", "-o", out), 2);
}

struct place {
    uint64_t offset, length;
    struct bytes_buffer indexes; /* message_index_offsets */
};

/* A summary with as many indexes of the chunk as there are places. */
static void put_summary(struct bytes_buffer *b, const struct place *places, size_t n,
                        uint64_t n_messages)
{
    struct bag_record r = {.opcode = BAG_STATISTICS};
    uint64_t start = b->size;

    hostile_put_channel(b, 1, "t");
    r.statistics.message_count = n_messages;
    r.statistics.channel_count = 1;
    r.statistics.chunk_count = (uint32_t)n;
    bag_record_put(b, &r);
    r = (struct bag_record){.opcode = BAG_CHUNK_INDEX};
    for (size_t i = 0; i < n; i++) {
        r.chunk_index.chunk_start_offset = places[i].offset;
        r.chunk_index.chunk_length = places[i].length;
        r.chunk_index.message_index_offsets = bytes_in(&places[i].indexes);
        r.chunk_index.message_end_time = 10;
        bag_record_put(b, &r);
    }
    hostile_finish(b, hostile, start, 0);
}

/* Chunk 2 begins inside of chunk 1, where bytes of its data look like one. */
static void chunks_that_overlap_are_refused(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin(), inner = {0}, records = {0};
    struct bag_record chunk = {.opcode = BAG_CHUNK};
    struct place places[2] = {{.offset = b.size}, {.offset = 0}};

    hostile_put_channel(&inner, 1, "t");
    hostile_put_message(&inner, 5);
    chunk.chunk.records = bytes_in(&inner);
    chunk.chunk.uncompressed_size = inner.size;
    bag_record_put(&records, &chunk); /* in an attachment's place: a chunk in a chunk */
    hostile_put_channel(&records, 1, "t");
    hostile_put_message(&records, 6);
    size_t inner_size = BAG_RECORD_HEAD_SIZE + 40 + inner.size;
    chunk.chunk.records = bytes_in(&records);
    chunk.chunk.uncompressed_size = records.size;
    bag_record_put(&b, &chunk);
    places[0].length = b.size - places[0].offset;
    places[1].offset = b.size - records.size;
    places[1].length = inner_size;
    bytes_free(&inner);
    bytes_free(&records);
    hostile_end_data(&b);
    put_summary(&b, places, 2, 2);
    assert_refused_by_all(1);
}

/* One index of messages is named by its chunk 60000 times. */
static void an_index_that_is_named_again_and_again_is_bounded(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin(), records = {0}, entries = {0};
    struct bag_record index = {.opcode = BAG_MESSAGE_INDEX};
    struct place place = {.offset = b.size};

    hostile_put_channel(&records, 1, "t");
    hostile_put_message(&records, 5);
    hostile_put_chunk(&b, &records, 0);
    place.length = b.size - place.offset;
    uint64_t at = b.size;
    index.message_index.channel_id = 1;
    for (int i = 0; i < 60000; i++) {
        bytes_put_number(&entries, 5, 8);
        bytes_put_number(&entries, 0, 8);
        bytes_put_number(&place.indexes, 1, 2);
        bytes_put_number(&place.indexes, at, 8);
    }
    index.message_index.entries = bytes_in(&entries);
    bag_record_put(&b, &index);
    hostile_end_data(&b);
    put_summary(&b, &place, 1, 1);
    bytes_free(&entries);
    bytes_free(&place.indexes);
    struct verdict v = judge_all();
    assert_int_equal(v.info, 0); /* what it really holds, found by reading it */
    assert_int_equal(v.check, 1);
    assert_int_equal(v.json, 0);
}

/* The summary, its offsets and the index of a chunk all point at the summary. */
static void a_summary_that_points_at_itself_ends(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin();
    struct bag_record r = {.opcode = BAG_STATISTICS};

    hostile_end_data(&b);
    uint64_t start = b.size;
    r.statistics.chunk_count = 1;
    bag_record_put(&b, &r);
    r = (struct bag_record){.opcode = BAG_CHUNK_INDEX};
    r.chunk_index.chunk_start_offset = start;
    r.chunk_index.chunk_length = 100;
    bag_record_put(&b, &r);
    r = (struct bag_record){.opcode = BAG_SUMMARY_OFFSET};
    r.summary_offset.group_opcode = BAG_SUMMARY_OFFSET;
    r.summary_offset.group_start = start;
    r.summary_offset.group_length = 1000;
    uint64_t offsets = b.size;
    bag_record_put(&b, &r);
    hostile_finish(&b, hostile, start, offsets);
    assert_int_equal(judge_all().check, 1);
}

/* As many as ids can tell apart, each with a name of its own. */
static void as_many_topics_as_there_can_be_are_listed(void **state)
{
    (void)state;
    struct bytes_buffer b = hostile_begin();
    char name[16];

    for (unsigned i = 1; i <= UINT16_MAX; i++) {
        snprintf(name, sizeof name, "topic %u", i);
        hostile_put_channel(&b, (uint16_t)i, name);
    }
    hostile_put_message(&b, 5);
    hostile_end_data(&b);
    hostile_finish(&b, hostile, 0, 0);
    struct verdict v = judge_all();
    assert_int_equal(v.info, 0);
    assert_int_equal(v.check, 0);
    assert_int_equal(v.recover, 0);
    assert_int_equal(v.filter, 0);
    assert_int_equal(v.merge, 0);
    assert_int_equal(v.json, 0);
}

/* Every survey has another id, and none belongs to the ping. */
static void surveys_without_number_are_refused(void **state)
{
    (void)state;
    static const struct bag_writer_config cfg = {
        .profile = "anlos", .library = "test", .chunk_size = MB};
    struct error why = {""};
    struct bag_writer *w;
    struct bag_topics *topics;
    struct envelope e = {.node = "array", .epoch_ns = 5};

    unlink(hostile);
    assert_int_equal(bag_writer_create(&w, hostile, &cfg, &why), 0);
    assert_int_equal(bag_topics_create(&topics, w), 0);
    for (unsigned i = 0; i < 400000; i++) {
        const uint8_t payload[] = {0x08, 0x80 | (i & 0x7f), 0x80 | (i >> 7 & 0x7f),
                                   0x80 | (i >> 14 & 0x7f), 1};
        strcpy(e.topic, i ? "survey" : "ping");
        e.payload_size = i ? sizeof payload : 0;
        e.sequence = e.publish_ns = i;
        assert_int_equal(bag_topics_put(topics, &e, payload, NULL, &why), 0);
    }
    bag_topics_destroy(topics);
    assert_int_equal(bag_writer_close(w, &why), 0);
    assert_int_equal(bag("export", hostile, "--format", "wav", "-o", out), 2);
    assert_int_equal(bag("info", hostile), 0);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, make_folder, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(a_record_of_2_to_the_63_bytes_is_refused),
        TEST(a_chunk_that_claims_2_to_the_63_bytes_is_refused),
        TEST(many_bombs_are_refused),
        TEST(a_chunk_of_millions_of_messages_is_read_in_bounded_time),
        TEST(chunks_that_overlap_are_refused),
        TEST(an_index_that_is_named_again_and_again_is_bounded),
        TEST(a_summary_that_points_at_itself_ends),
        TEST(as_many_topics_as_there_can_be_are_listed),
        TEST(surveys_without_number_are_refused),
    };
    const struct rlimit cpu = {MAX_CPU_S, MAX_CPU_S};
    if (memory_limit(MEMORY) || setrlimit(RLIMIT_CPU, &cpu))
        return 1;
    return cmocka_run_group_tests(tests, NULL, NULL);
}
