/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <string.h>

#include "msgs/envelope.h"

/* Written by hand from the layout in msgs/envelope.h. */
static const uint8_t golden[ENVELOPE_SIZE + 3] = {
    /* clang-format off */
    's', 'c', 'a', 'n', '/', 's', 't', 'a', 't', 'u', 's', 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    'N', 'L', 'O', 'S',
    1, 0, 0, 0,
    's', 'c', 'a', 'n', 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0x08, 0x07, 0x06, 0x05, 0x04, 0x03, 0x02, 0x01,
    0xff, 0xee, 0xdd, 0xcc, 0xbb, 0xaa, 0x99, 0x88,
    0xfe, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x3f,
    0x00, 0xca, 0x9a, 0x3b, 0x00, 0x00, 0x00, 0x00,
    3, 0, 0, 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    'a', 'b', 'c',
    /* clang-format on */
};

static struct envelope example(void)
{
    return (struct envelope){.topic = "scan/status",
                             .node = "scan",
                             .epoch_ns = INT64_C(0x0102030405060708),
                             .sequence = UINT64_C(0x8899aabbccddeeff),
                             .capture_ns = ENVELOPE_MAX_STAMP - 2,
                             .publish_ns = 1000000000,
                             .payload_size = 3};
}

static void packing_gives_the_bytes_of_the_layout(void **state)
{
    (void)state;
    struct envelope e = example();
    uint8_t out[ENVELOPE_SIZE];
    memset(out, 0xa5, sizeof out);
    envelope_pack(&e, out);
    assert_memory_equal(out, golden, ENVELOPE_SIZE);
}

static void unpacking_gives_back_every_field(void **state)
{
    (void)state;
    struct envelope e, expected = example();
    assert_int_equal(envelope_unpack(&e, golden, sizeof golden, 3), 0);
    assert_string_equal(e.topic, expected.topic);
    assert_string_equal(e.node, expected.node);
    assert_true(e.epoch_ns == expected.epoch_ns);
    assert_true(e.sequence == expected.sequence);
    assert_true(e.capture_ns == expected.capture_ns);
    assert_true(e.publish_ns == expected.publish_ns);
    assert_int_equal(e.payload_size, 3);
    assert_false(e.replayed);
}

static void what_is_replayed_stays_so(void **state)
{
    (void)state;
    struct envelope e = example();
    uint8_t out[ENVELOPE_SIZE + 3] = {0};
    e.replayed = true;
    envelope_pack(&e, out);
    assert_int_equal(out[84], 1);
    e.replayed = false;
    assert_int_equal(envelope_unpack(&e, out, sizeof out, 3), 0);
    assert_true(e.replayed);
}

static void names_that_fill_their_fields_survive(void **state)
{
    (void)state;
    struct envelope e = example(), back;
    uint8_t out[ENVELOPE_SIZE + 3] = {0};
    strcpy(e.topic, "twenty-three-characters");
    strcpy(e.node, "fifteen-letters");
    envelope_pack(&e, out);
    assert_int_equal(envelope_unpack(&back, out, sizeof out, 3), 0);
    assert_string_equal(back.topic, "twenty-three-characters");
    assert_string_equal(back.node, "fifteen-letters");
}

static void names_without_an_end_are_cut_when_packed(void **state)
{
    (void)state;
    struct envelope e = example(), back;
    uint8_t out[ENVELOPE_SIZE + 3] = {0};
    memset(e.topic, 't', sizeof e.topic);
    memset(e.node, 'n', sizeof e.node);
    envelope_pack(&e, out);
    assert_int_equal(envelope_unpack(&back, out, sizeof out, 3), 0);
    assert_int_equal(strlen(back.topic), ENVELOPE_TOPIC_SIZE - 1);
    assert_int_equal(strlen(back.node), ENVELOPE_NODE_SIZE - 1);
}

static void a_message_cut_at_any_length_is_refused(void **state)
{
    (void)state;
    for (size_t size = 0; size < sizeof golden; size++) {
        struct envelope e;
        assert_int_equal(envelope_unpack(&e, golden, size, 3), -EMSGSIZE);
        assert_int_equal(envelope_inspect(golden, size, 3),
                         size < ENVELOPE_SIZE ? ENVELOPE_SHORT : ENVELOPE_LENGTH);
    }
}

static void a_message_with_bytes_behind_its_end_is_refused(void **state)
{
    (void)state;
    uint8_t longer[sizeof golden + 1] = {0};
    struct envelope e;
    memcpy(longer, golden, sizeof golden);
    assert_int_equal(envelope_unpack(&e, longer, sizeof longer, 100), -EMSGSIZE);
    assert_int_equal(envelope_inspect(longer, sizeof longer, 100), ENVELOPE_LENGTH);
}

static void a_payload_over_the_bound_is_refused(void **state)
{
    (void)state;
    struct envelope e;
    assert_int_equal(envelope_unpack(&e, golden, sizeof golden, 2), -EMSGSIZE);
    assert_int_equal(envelope_inspect(golden, sizeof golden, 2), ENVELOPE_TOO_LARGE);
}

static void every_malformed_field_is_refused(void **state)
{
    (void)state;
    static const struct {
        size_t at;
        uint8_t byte;
        enum envelope_fault fault;
        int err;
    } cases[] = {
        {24, 'X', ENVELOPE_FOREIGN, -EPROTO},
        {27, 's', ENVELOPE_FOREIGN, -EPROTO},
        {28, 0, ENVELOPE_OTHER_VERSION, -EPROTO},
        {28, 2, ENVELOPE_OTHER_VERSION, -EPROTO},
        {31, 1, ENVELOPE_OTHER_VERSION, -EPROTO},
        {0, 0, ENVELOPE_GARBLED, -EPROTO},    /* an empty topic */
        {23, 'x', ENVELOPE_GARBLED, -EPROTO}, /* something behind its end */
        {32, 0, ENVELOPE_GARBLED, -EPROTO},
        {47, 'x', ENVELOPE_GARBLED, -EPROTO},
        {71, 0xff, ENVELOPE_GARBLED, -EPROTO}, /* stamps before 1970, after 2116 */
        {79, 0x41, ENVELOPE_GARBLED, -EPROTO},
        {84, 2, ENVELOPE_GARBLED, -EPROTO},
        {85, 1, ENVELOPE_GARBLED, -EPROTO},
        {95, 1, ENVELOPE_GARBLED, -EPROTO},
        {80, 2, ENVELOPE_LENGTH, -EMSGSIZE},
        {80, 4, ENVELOPE_LENGTH, -EMSGSIZE},
        {83, 0xff, ENVELOPE_LENGTH, -EMSGSIZE},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t bytes[sizeof golden];
        struct envelope e;
        memcpy(bytes, golden, sizeof bytes);
        bytes[cases[i].at] = cases[i].byte;
        assert_int_equal(envelope_inspect(bytes, sizeof bytes, 3), cases[i].fault);
        assert_int_equal(envelope_unpack(&e, bytes, sizeof bytes, 3), cases[i].err);
    }
}

static void a_name_without_an_end_is_refused(void **state)
{
    (void)state;
    uint8_t bytes[sizeof golden];
    memcpy(bytes, golden, sizeof bytes);
    memset(bytes, 't', ENVELOPE_TOPIC_SIZE);
    assert_int_equal(envelope_inspect(bytes, sizeof bytes, 3), ENVELOPE_GARBLED);
    memcpy(bytes, golden, sizeof bytes);
    memset(bytes + 32, 'n', ENVELOPE_NODE_SIZE);
    assert_int_equal(envelope_inspect(bytes, sizeof bytes, 3), ENVELOPE_GARBLED);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packing_gives_the_bytes_of_the_layout),
        cmocka_unit_test(unpacking_gives_back_every_field),
        cmocka_unit_test(what_is_replayed_stays_so),
        cmocka_unit_test(names_that_fill_their_fields_survive),
        cmocka_unit_test(names_without_an_end_are_cut_when_packed),
        cmocka_unit_test(a_message_cut_at_any_length_is_refused),
        cmocka_unit_test(a_message_with_bytes_behind_its_end_is_refused),
        cmocka_unit_test(a_payload_over_the_bound_is_refused),
        cmocka_unit_test(every_malformed_field_is_refused),
        cmocka_unit_test(a_name_without_an_end_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
