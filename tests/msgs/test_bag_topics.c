/* SPDX-License-Identifier: MIT */
/* Messages of the bus in a bag, and what a bag says of their schemas. */
#include <errno.h>

#include "bag_rig.h"

#include "msgs/bag/catalog.h"
#include "msgs/bag/schemas.h"
#include "msgs/bag/topic_message.h"

/* The next field of a protobuf message; independent of protobuf-c.  false: the end. */
static bool next_field(struct bytes *left, unsigned *number, struct bytes *value)
{
    uint64_t v[2] = {0, 0};

    if (!left->size)
        return false;
    for (int i = 0; i < 2; i++) {
        unsigned shift = 0;
        uint8_t b;
        do {
            assert_true(left->size && shift < 64);
            b = *left->data++;
            left->size--;
            v[i] |= (uint64_t)(b & 0x7f) << shift;
            shift += 7;
        } while (b & 0x80);
    }
    *number = (unsigned)(v[0] >> 3);
    *value = (struct bytes){left->data, 0};
    if ((v[0] & 7) == 0) /* a number: v[1] is all of it */
        return true;
    assert_int_equal(v[0] & 7, 2);
    assert_true(v[1] <= left->size);
    value->size = (size_t)v[1];
    left->data += v[1];
    left->size -= (size_t)v[1];
    return true;
}

static bool has_text(struct bytes message, unsigned field, const char *text)
{
    struct bytes value;
    unsigned number;

    while (next_field(&message, &number, &value))
        if (number == field && bytes_equal(value, bytes_of(text)))
            return true;
    return false;
}

/* In the descriptor of a message (field 4 of a file's): its field names, and how many. */
static size_t check_fields(struct bytes descriptor, const ProtobufCMessageDescriptor *d)
{
    struct bytes value;
    unsigned number;
    size_t n = 0;

    while (next_field(&descriptor, &number, &value)) {
        if (number != 2)
            continue;
        assert_true(n < d->n_fields);
        bool found = false;
        for (unsigned i = 0; i < d->n_fields; i++)
            found |= has_text(value, 1, d->fields[i].name);
        assert_true(found);
        n++;
    }
    return n;
}

/* FileDescriptorSet.file is 1; FileDescriptorProto: name 1, package 2, dependency 3,
 * message_type 4; DescriptorProto: name 1, field 2 (google/protobuf/descriptor.proto). */
static void every_topic_has_a_schema_with_its_fields_and_imports(void **state)
{
    (void)state;
    for (const struct topic *t = topics_all(); t->name; t++) {
        struct bag_schema s = bag_schema_of(t);
        struct bytes left = s.data, file, part;
        unsigned number;
        size_t n_found = 0;
        const char *short_name = strrchr(t->schema->name, '.') + 1;

        assert_true(bytes_equal(s.name, bytes_of(t->schema->name)));
        assert_true(bytes_equal(s.encoding, bytes_of("protobuf")));
        assert_true(s.data.size > 0);
        while (next_field(&left, &number, &file)) {
            struct bytes in_file = file;
            assert_int_equal(number, 1);
            while (next_field(&in_file, &number, &part)) {
                char import[64];
                struct bytes others = s.data, other;
                bool there = false;
                unsigned one;
                if (number == 4 && has_text(part, 1, short_name)) {
                    assert_int_equal(check_fields(part, t->schema), t->schema->n_fields);
                    n_found++;
                }
                if (number != 3)
                    continue;
                snprintf(import, sizeof import, "%.*s", (int)part.size,
                         (const char *)part.data);
                while (next_field(&others, &one, &other))
                    there |= has_text(other, 1, import);
                assert_true(there);
            }
        }
        assert_int_equal(n_found, 1);
    }
}

#define N_SENT 6

static const struct envelope sent[N_SENT] = {
    {.topic = "survey",
     .node = "array",
     .epoch_ns = 5,
     .sequence = 0,
     .publish_ns = 1000,
     .payload_size = 3},
    {.topic = "ping",
     .node = "array",
     .epoch_ns = 5,
     .sequence = 7,
     .capture_ns = 900,
     .publish_ns = 1001,
     .payload_size = 0},
    {.topic = "ping", /* taken and sent at one time */
     .node = "array",
     .epoch_ns = 5,
     .sequence = 8,
     .capture_ns = 1002,
     .publish_ns = 1002,
     .payload_size = 2},
    {.topic = "health",
     .node = "a fifteen chars",
     .epoch_ns = INT64_MAX,
     .sequence = UINT32_MAX,
     .publish_ns = 1003,
     .payload_size = 1},
    {.topic = "health", /* started anew */
     .node = "a fifteen chars",
     .epoch_ns = INT64_MIN,
     .publish_ns = 1003,
     .payload_size = 1},
    {.topic = "ping", /* of no sound */
     .node = "array",
     .epoch_ns = 5,
     .sequence = 9,
     .publish_ns = 1004,
     .payload_size = 1},
};

static void what_went_over_the_bus_comes_back_out_of_a_bag(void **state)
{
    const struct bag_writer_config cfg = {.profile = "", .library = "", .chunk_size = 99};
    const uint8_t payload[] = {1, 2, 3};
    struct error why = {""};
    struct bag_writer *w;
    struct bag_topics *t;
    struct bag_reader *r;
    struct bag_record record;
    struct bag_catalog *catalog;
    size_t n = 0;

    assert_int_equal(bag_writer_create(&w, scratch_path(*state, "a.mcap"), &cfg, &why),
                     0);
    assert_int_equal(bag_topics_create(&t, w), 0);
    for (size_t i = 0; i < N_SENT; i++)
        assert_int_equal(bag_topics_put(t, &sent[i], payload, NULL, &why), 0);
    bag_topics_destroy(t);
    assert_int_equal(bag_writer_close(w, &why), 0);

    const char *path = ((struct scratch *)*state)->path;
    assert_int_equal(bag_catalog_open(&catalog, path, &why), 0);
    assert_int_equal(catalog->n_schemas, 3);
    assert_int_equal(catalog->n_channels, 5);
    assert_int_equal(bag_reader_open(&r, path, &why), 0);
    while (!bag_reader_next(r, &record, &why)) {
        struct bag_source source;
        struct envelope e;
        uint8_t packed[2][ENVELOPE_SIZE];
        if (record.opcode != BAG_MESSAGE)
            continue;
        assert_int_equal(bag_source_of(&source, bag_catalog_channel(
                                                    catalog, record.message.channel_id)),
                         0);
        bag_source_envelope(&source, &record.message, &e);
        assert_true(n < N_SENT);
        envelope_pack(&e, packed[0]);
        envelope_pack(&sent[n], packed[1]);
        assert_memory_equal(packed[0], packed[1], ENVELOPE_SIZE);
        assert_memory_equal(record.message.data.data, payload, sent[n].payload_size);
        n++;
    }
    assert_int_equal(n, N_SENT);
    bag_reader_close(r);
    bag_catalog_close(catalog);
}

static void a_topic_that_there_is_not_is_refused(void **state)
{
    const struct bag_writer_config cfg = {.profile = "", .library = ""};
    struct error why = {""};
    struct bag_writer *w;
    struct bag_topics *t;
    const struct envelope e = {.topic = "weather", .node = "array"};

    assert_int_equal(bag_writer_create(&w, scratch_path(*state, "a.mcap"), &cfg, &why),
                     0);
    assert_int_equal(bag_topics_create(&t, w), 0);
    assert_int_equal(bag_topics_put(t, &e, "", NULL, &why), -EINVAL);
    assert_contains(why.text, "weather");
    bag_topics_destroy(t);
    assert_int_equal(bag_writer_close(w, &why), 0);
}

/* A channel "ping" with one pair of metadata left out or changed. */
static int source_of(const char *skip, const char *node, const char *epoch)
{
    const char *const pairs[3][2] = {
        {"node", node}, {"epoch_ns", epoch}, {"capture", "none"}};
    struct bytes_buffer map = {0};
    struct bag_channel channel = {.topic = bytes_of("ping"),
                                  .message_encoding = bytes_of("protobuf")};
    struct bag_source out;

    for (int i = 0; i < 3; i++)
        if (strcmp(pairs[i][0], skip))
            bag_map_put(&map, bytes_of(pairs[i][0]), bytes_of(pairs[i][1]));
    channel.metadata = bytes_in(&map);
    int err = bag_source_of(&out, &channel);
    bytes_free(&map);
    return err;
}

static void channels_of_others_are_told_apart(void **state)
{
    struct bag_source out;
    struct bag_channel foreign = {.topic = bytes_of("/camera/image"),
                                  .message_encoding = bytes_of("protobuf")};

    (void)state;
    assert_int_equal(source_of("", "array", "-12"), 0);
    assert_int_equal(source_of("node", "array", "12"), -EINVAL);
    assert_int_equal(source_of("epoch_ns", "array", "12"), -EINVAL);
    assert_int_equal(source_of("capture", "array", "12"), -EINVAL);
    assert_int_equal(source_of("", "", "12"), -EINVAL);
    assert_int_equal(source_of("", "sixteen letters.", "12"), -EINVAL);
    assert_int_equal(source_of("", "array", "12s"), -EINVAL);
    assert_int_equal(source_of("", "array", "99999999999999999999"), -EINVAL);
    assert_int_equal(bag_source_of(&out, &foreign), -EINVAL);
}

int main(void)
{
#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)
    const struct CMUnitTest tests[] = {
        TEST(every_topic_has_a_schema_with_its_fields_and_imports),
        TEST(what_went_over_the_bus_comes_back_out_of_a_bag),
        TEST(a_topic_that_there_is_not_is_refused),
        TEST(channels_of_others_are_told_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
