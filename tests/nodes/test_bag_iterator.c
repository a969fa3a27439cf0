/* SPDX-License-Identifier: MIT */
#include "tests/nodes/played_bag.h"

#include <errno.h>
#include <math.h>

#include "msgs/detections.pb-c.h"
#include "msgs/shuffle.h"
#include "msgs/tensor.h"
#include "nodes/play/bag_iterator.h"

static struct bag_iterator *open_bag_iterator(struct scratch *s, const char *remap)
{
    const struct bag_iterator_config cfg = {
        .bag = scratch_path(s, "a.mcap"), .end_s = INFINITY, .remap = remap};
    struct error why = {""};
    struct bag_iterator *t = NULL;

    if (bag_iterator_open(&t, &cfg, &why))
        fail_msg("%s", why.text);
    return t;
}

static void messages_come_with_the_envelope_they_had(void **state)
{
    struct scratch *s = *state;
    struct bag_iterator_message m;
    size_t n = 0, pings = 0;

    played_bag_write(scratch_path(s, "a.mcap"), true);
    struct bag_iterator *t = open_bag_iterator(s, NULL);
    assert_true(bag_iterator_start_ns(t) == FIRST_NS);
    assert_true(bag_iterator_end_ns(t) == FIRST_NS + 9 * STEP_NS);
    bag_iterator_seek(t, bag_iterator_start_ns(t));
    for (; !bag_iterator_next(t, &m, NULL); n++) {
        assert_true(m.envelope.publish_ns == FIRST_NS + (int64_t)n * STEP_NS);
        assert_int_equal(m.envelope.sequence, n);
        bool ping = m.part->topic == topic_ping();
        assert_true(m.envelope.capture_ns == (ping ? m.envelope.publish_ns - 1000 : 0));
        assert_string_equal(m.part->node,
                            m.part->topic == topic_scan_status() ? "scan" : "array");
        pings += ping;
    }
    assert_int_equal(n, 10);
    assert_int_equal(pings, N_PINGS);
    bag_iterator_close(t);
}

static void parts_that_are_not_wanted_are_passed_over(void **state)
{
    struct scratch *s = *state;
    struct bag_iterator_part *part;
    struct bag_iterator_message m;
    size_t n = 0;

    played_bag_write(scratch_path(s, "a.mcap"), true);
    struct bag_iterator *t = open_bag_iterator(s, NULL);
    for (size_t i = 0; (part = bag_iterator_part(t, i)); i++)
        part->wanted = part->topic != topic_ping();
    bag_iterator_seek(t, FIRST_NS + STEP_NS);
    for (; !bag_iterator_next(t, &m, NULL); n++)
        assert_ptr_equal(m.part->topic, topic_scan_status());
    assert_int_equal(n, 3);
    bag_iterator_close(t);
}

static void the_survey_of_any_time_is_found(void **state)
{
    struct scratch *s = *state;
    struct played_bag b;
    struct bag_iterator_message m;

    played_bag_open(&b, scratch_path(s, "a.mcap"));
    b.at_ns = FIRST_NS - STEP_NS;
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__RUNNING);
    for (int i = 0; i < 3; i++) {
        b.at_ns = FIRST_NS + 10000000000 * i;
        played_bag_survey(&b);
    }
    played_bag_close(&b);
    struct bag_iterator *t = open_bag_iterator(s, NULL);
    const struct {
        int64_t at, found;
    } cases[] = {{-STEP_NS, 0},
                 {0, 0},
                 {10000000000 - 1, 10000000000}, /* two seconds are what it looks back */
                 {10000000000, 10000000000},
                 {11000000000, 10000000000},
                 {20000000000 + STEP_NS, 20000000000},
                 {30000000000, 0}}; /* none near: the first one of all, as good as any */
    for (size_t i = 0; i < 6; i++) {
        assert_int_equal(bag_iterator_find_survey(t, FIRST_NS + cases[i].at, &m, NULL),
                         0);
        assert_int_equal(m.envelope.publish_ns - FIRST_NS, cases[i].found);
    }
    assert_int_equal(bag_iterator_find_survey(t, FIRST_NS + 30000000000, &m, NULL), 0);
    assert_ptr_equal(m.part->topic, topic_survey());
    bag_iterator_close(t);
}

static void a_foreign_name_can_be_given_a_topic(void **state)
{
    struct scratch *s = *state;
    const struct bag_writer_config cfg = {.profile = "", .library = "other"};
    const char *path = scratch_path(s, "a.mcap");
    Anlos__ScanStatus status = ANLOS__SCAN_STATUS__INIT;
    struct bag_writer *w;
    struct bag_iterator_message m;
    struct bag_iterator *t = NULL;
    struct error why;
    uint16_t schema, channel;
    uint8_t bytes[64];

    status.scan = 4;
    assert_int_equal(bag_writer_create(&w, path, &cfg, NULL), 0);
    assert_int_equal(
        bag_writer_schema(w,
                          &(struct bag_schema){.name = bytes_of("anlos.ScanStatus"),
                                               .encoding = bytes_of("protobuf")},
                          &schema, NULL),
        0);
    assert_int_equal(bag_writer_channel(
                         w,
                         &(struct bag_channel){.schema_id = schema,
                                               .topic = bytes_of("/robot/scan"),
                                               .message_encoding = bytes_of("protobuf")},
                         &channel, NULL),
                     0);
    const struct bag_message message = {
        .channel_id = channel,
        .log_time = 50,
        .publish_time = 40,
        .data = {bytes, anlos__scan_status__pack(&status, bytes)}};
    assert_int_equal(bag_writer_message(w, &message, NULL), 0);
    assert_int_equal(bag_writer_close(w, NULL), 0);

    const struct bag_iterator_config plain = {.bag = path, .end_s = INFINITY};
    assert_int_equal(bag_iterator_open(&t, &plain, &why), -ENODATA);
    t = open_bag_iterator(s, "/robot/scan:=scan/status");
    bag_iterator_seek(t, 0);
    assert_int_equal(bag_iterator_next(t, &m, NULL), 0);
    assert_ptr_equal(m.part->topic, topic_scan_status());
    assert_string_equal(m.part->node, "scan");
    assert_int_equal(m.envelope.publish_ns, 50);
    bag_iterator_close(t);
}

static void a_replay_says_so_and_counts_its_scans_on(void **state)
{
    Anlos__DetectionList list = ANLOS__DETECTION_LIST__INIT;
    Anlos__Receipt receipt = ANLOS__RECEIPT__INIT;
    struct bytes_buffer into = {0};
    uint8_t bytes[64];

    (void)state;
    list.scan = 3;
    list.counter = 8;
    list.source = ANLOS__SOURCE__LIVE;
    struct bytes payload = {bytes, anlos__detection_list__pack(&list, bytes)};
    assert_int_equal(rewrite(topic_detections(), 2, 0, &payload, &into), 0);
    Anlos__DetectionList *back =
        anlos__detection_list__unpack(NULL, payload.size, payload.data);
    assert_non_null(back);
    assert_int_equal(back->scan, 5);
    assert_int_equal(back->counter, 8);
    assert_int_equal(back->source, ANLOS__SOURCE__REPLAY);
    anlos__detection_list__free_unpacked(back, NULL);

    receipt.scan = 7;
    payload = (struct bytes){bytes, anlos__receipt__pack(&receipt, bytes)};
    assert_int_equal(rewrite(topic_receipt(), 0, 0, &payload, &into), 0);
    assert_ptr_equal(payload.data, bytes); /* nothing to be said otherwise */
    assert_int_equal(rewrite(topic_receipt(), 1, 0, &payload, &into), 0);
    assert_ptr_not_equal(payload.data, bytes);
    payload = (struct bytes){(const uint8_t *)"\xff\xff", 2};
    assert_int_equal(rewrite(topic_receipt(), 1, 0, &payload, &into), -EPROTO);
    bytes_free(&into);
}

static uint64_t survey_after(const Anlos__Ping *ping)
{
    struct bytes_buffer into = {0};
    uint8_t bytes[64];
    struct bytes payload = {bytes, anlos__ping__pack(ping, bytes)};

    assert_int_equal(rewrite(topic_ping(), 0, 77, &payload, &into), 0);
    Anlos__Ping *back = anlos__ping__unpack(NULL, payload.size, payload.data);
    assert_non_null(back);
    assert_int_equal(back->speaker, ping->speaker);
    uint64_t id = back->survey_id;
    anlos__ping__free_unpacked(back, NULL);
    bytes_free(&into);
    return id;
}

static void what_says_of_no_survey_is_of_the_newest(void **state)
{
    Anlos__Ping ping = ANLOS__PING__INIT;

    (void)state;
    ping.speaker = 3;
    assert_true(survey_after(&ping) == 77);
    ping.survey_id = 5;
    assert_true(survey_after(&ping) == 5);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, scratch_open, scratch_close)

/* Who hears it may be of before; and who records it has not asked for it. */
static void what_was_shuffled_for_the_bag_is_played_as_it_was(void **state)
{
    const float x[] = {0.5f, -0.25f, 0.1f, 3e-5f};
    struct bytes_buffer shuffled = {0}, into = {0};
    Anlos__Ping p = ANLOS__PING__INIT;
    struct tensor_view view;
    uint8_t packed[200];

    (void)state;
    p.survey_id = 77;
    p.samples = tensor_borrow_f32(&view, x, 2, (size_t)1, (size_t)4);
    const struct bytes plain = {packed, anlos__ping__pack(&p, packed)};
    assert_int_equal(payload_shuffle(&shuffled, &anlos__ping__descriptor, plain, true),
                     0);
    struct bytes payload = bytes_in(&shuffled);
    assert_int_equal(rewrite(topic_ping(), 0, 77, &payload, &into), 0);
    assert_true(bytes_equal(payload, plain));
    payload = plain;
    assert_int_equal(rewrite(topic_ping(), 0, 77, &payload, &into), 0);
    assert_ptr_equal(payload.data, packed);
    payload.size = 5; /* is none: whoever hears it says so */
    assert_int_equal(rewrite(topic_ping(), 0, 77, &payload, &into), 0);
    assert_ptr_equal(payload.data, packed);
    bytes_free(&shuffled);
    bytes_free(&into);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(messages_come_with_the_envelope_they_had),
        TEST(parts_that_are_not_wanted_are_passed_over),
        TEST(the_survey_of_any_time_is_found),
        TEST(a_foreign_name_can_be_given_a_topic),
        TEST(a_replay_says_so_and_counts_its_scans_on),
        TEST(what_says_of_no_survey_is_of_the_newest),
        TEST(what_was_shuffled_for_the_bag_is_played_as_it_was),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
