/* SPDX-License-Identifier: MIT */
/* tests/nodes/played_bag.h -- a small bag for who plays it: a survey, a scan of two
 * positions and three speakers without a background, 0.1 s between its messages. */
#ifndef ANLOS_TESTS_NODES_PLAYED_BAG_H
#define ANLOS_TESTS_NODES_PLAYED_BAG_H

#include "tests/hal/scratch.h"

#include "msgs/array.pb-c.h"
#include "msgs/bag/topic_message.h"
#include "msgs/scan.pb-c.h"
#include "msgs/survey.pb-c.h"

#define FIRST_NS    INT64_C(1000000000000)
#define STEP_NS     INT64_C(100000000)
#define N_SPEAKERS  3
#define N_POSITIONS 2
#define N_PINGS     (N_POSITIONS * N_SPEAKERS)

struct played_bag {
    struct bag_writer *writer;
    struct bag_topics *topics;
    int64_t at_ns;
    int64_t epoch_ns;
    uint64_t sequence;
};

static inline void played_bag_open(struct played_bag *b, const char *path)
{
    const struct bag_writer_config cfg = {
        .profile = "anlos", .library = "test", .chunk_size = 4096};

    *b = (struct played_bag){.at_ns = FIRST_NS, .epoch_ns = 1};
    assert_int_equal(bag_writer_create(&b->writer, path, &cfg, NULL), 0);
    assert_int_equal(bag_topics_create(&b->topics, b->writer), 0);
}

static inline void played_bag_put(struct played_bag *b, const char *node,
                                  const struct topic *t, int64_t capture_ns,
                                  const ProtobufCMessage *m)
{
    uint8_t bytes[4096];
    struct envelope e = {.epoch_ns = b->epoch_ns,
                         .sequence = b->sequence++,
                         .capture_ns = capture_ns,
                         .publish_ns = b->at_ns};

    assert_true(protobuf_c_message_get_packed_size(m) <= sizeof bytes);
    e.payload_size = (uint32_t)protobuf_c_message_pack(m, bytes);
    snprintf(e.topic, sizeof e.topic, "%s", t->name);
    snprintf(e.node, sizeof e.node, "%s", node);
    assert_int_equal(bag_topics_put(b->topics, &e, bytes, NULL, NULL), 0);
    b->at_ns += STEP_NS;
}

static inline void played_bag_survey(struct played_bag *b)
{
    Anlos__Survey s = ANLOS__SURVEY__INIT;
    double positions[N_POSITIONS] = {0.0, 0.1};
    Anlos__Vec3 at = ANLOS__VEC3__INIT, *speakers[N_SPEAKERS] = {&at, &at, &at};

    s.id = 99;
    s.source = ANLOS__SOURCE__LIVE;
    s.n_stage_positions_m = N_POSITIONS;
    s.stage_positions_m = positions;
    s.n_speakers_m = N_SPEAKERS;
    s.speakers_m = speakers;
    played_bag_put(b, "array", topic_survey(), 0, &s.base);
}

static inline void played_bag_status(struct played_bag *b, Anlos__ScanStatus__State state)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;

    s.state = state;
    s.scan = 1;
    played_bag_put(b, "scan", topic_scan_status(), 0, &s.base);
}

static inline void played_bag_ping(struct played_bag *b, uint32_t i)
{
    Anlos__Ping p = ANLOS__PING__INIT;

    p.survey_id = 99;
    p.scan = 1;
    p.pass = ANLOS__PASS__SCENE;
    p.position = i / N_SPEAKERS;
    p.speaker = i % N_SPEAKERS;
    p.valid = true;
    played_bag_put(b, "array", topic_ping(), b->at_ns - 1000, &p.base);
}

/* Of an array that stands: the round counts from 1. */
static inline void played_bag_round(struct played_bag *b, uint32_t frame)
{
    for (uint32_t i = 0; i < N_SPEAKERS; i++) {
        Anlos__Ping p = ANLOS__PING__INIT;

        p.survey_id = 99;
        p.scan = 1;
        p.pass = ANLOS__PASS__SCENE;
        p.speaker = i;
        p.frame = frame;
        p.valid = true;
        played_bag_put(b, "array", topic_ping(), b->at_ns - 1000, &p.base);
    }
}

static inline void played_bag_close(struct played_bag *b)
{
    bag_topics_destroy(b->topics);
    assert_int_equal(bag_writer_close(b->writer, NULL), 0);
}

/* survey, RUNNING, all pings, and with `ends` DONE twice. */
static inline void played_bag_write(const char *path, bool ends)
{
    struct played_bag b;

    played_bag_open(&b, path);
    played_bag_survey(&b);
    played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__RUNNING);
    for (uint32_t i = 0; i < N_PINGS; i++)
        played_bag_ping(&b, i);
    for (int i = 0; ends && i < 2; i++)
        played_bag_status(&b, ANLOS__SCAN_STATUS__STATE__DONE);
    played_bag_close(&b);
}

#endif
