/* SPDX-License-Identifier: MIT */
/* tests/msgs/bag_rig.h -- bags whose messages tell which one they are. */
#ifndef ANLOS_TESTS_MSGS_BAG_RIG_H
#define ANLOS_TESTS_MSGS_BAG_RIG_H

#include "../hal/scratch.h"

#include "msgs/bag/reader.h"
#include "msgs/bag/writer.h"

#define N_MESSAGES 1000

static inline uint64_t time_of(size_t i)
{
    return 1000 + 10 * (i ^ 3); /* not in order */
}

/* Content that tells which message it is and can be compressed. */
static inline struct bytes content(size_t i, char out[200])
{
    int n = snprintf(out, 200, "message %zu of %d, again: message %zu of %d", i,
                     N_MESSAGES, i, N_MESSAGES);
    return (struct bytes){(const uint8_t *)out, (size_t)n};
}

static inline struct bag_writer *start(const char *path, size_t chunk_size,
                                       enum bag_compression compression)
{
    const struct bag_writer_config cfg = {.profile = "anlos",
                                          .library = "test",
                                          .chunk_size = chunk_size,
                                          .compression = compression};
    struct error why = {""};
    struct bag_writer *w;
    uint16_t id;

    if (bag_writer_create(&w, path, &cfg, &why))
        fail_msg("%s", why.text);
    assert_int_equal(
        bag_writer_schema(w, &(struct bag_schema){.name = bytes_of("text")}, &id, &why),
        0);
    for (int i = 0; i < 2; i++)
        assert_int_equal(
            bag_writer_channel(w,
                               &(struct bag_channel){
                                   .schema_id = 1, .topic = bytes_of(i ? "odd" : "even")},
                               &id, &why),
            0);
    return w;
}

static inline void put(struct bag_writer *w, size_t i)
{
    char text[200];
    struct error why = {""};
    const struct bag_message m = {.channel_id = (uint16_t)(1 + i % 2),
                                  .sequence = (uint32_t)i,
                                  .log_time = time_of(i),
                                  .publish_time = time_of(i) + 1,
                                  .data = content(i, text)};
    if (bag_writer_message(w, &m, &why))
        fail_msg("%s", why.text);
}

static inline void check_message(const struct bag_message *m)
{
    char text[200];

    assert_true(m->sequence < N_MESSAGES);
    assert_int_equal(m->channel_id, 1 + m->sequence % 2);
    assert_int_equal(m->log_time, time_of(m->sequence));
    assert_int_equal(m->publish_time, time_of(m->sequence) + 1);
    assert_true(bytes_equal(m->data, content(m->sequence, text)));
}

#endif
