/* SPDX-License-Identifier: MIT */
/* msgs/bag/topic_message.h -- a message of the bus as a message of a bag and back,
 * without loss: what comes out of a bag is, byte for byte, what went over the bus, but
 * for the order of the bytes in what was shuffled (msgs/shuffle.h).
 *
 *   envelope      in the bag
 *   topic         the channel's topic
 *   node          the channel's metadata "node"
 *   epoch_ns      the channel's metadata "epoch_ns", a decimal number
 *   sequence      the message's sequence, which has 32 bits: 8 years at 16 Hz
 *   publish_ns    log_time
 *   capture_ns    publish_time; channel metadata "capture" is "publish_time" then, and
 *                 "none" where the messages are of no sound (capture_ns 0)
 *   payload       data, protobuf
 *
 * log_time is what every tool orders and seeks by.  It is the sender's stamp and not the
 * recorder's clock, so that a bag tells the same whoever recorded it, when, and how often
 * it was copied.  The capture stamp decides results downstream (latency, order of scans),
 * so it must not get lost, and publish_time is the only other time that a message has.
 * Where there is none, publish_time is log_time, as the format asks for; whether there is
 * one stands in the channel, because the two times may be equal by chance.  So there is
 * one channel for each topic, node and start of that node -- two if it sends both with
 * and without a capture stamp. */
#ifndef ANLOS_MSGS_BAG_TOPIC_MESSAGE_H
#define ANLOS_MSGS_BAG_TOPIC_MESSAGE_H

#include <stdbool.h>

#include "msgs/bag/record.h"
#include "msgs/bag/writer.h"
#include "msgs/envelope.h"
#include "msgs/topics.h"

struct bag_topics; /* the channels of a bag that is being written */

/* The writer outlives it.  0, -ENOMEM. */
int bag_topics_create(struct bag_topics **out, struct bag_writer *w);

/* From now on sound and images are shuffled (msgs/shuffle.h), for the compression of the
 * writer's chunks: what is read of the bag is the same. */
void bag_topics_shuffle(struct bag_topics *t);

/* Does bag_topics_shuffle change its messages? */
bool bag_topic_is_shuffled(const struct topic *topic);

/* Writes a message whose envelope names a topic of msgs/topics.h; the payload has
 * e->payload_size bytes.  *channel_id: the one it is in; may be NULL.  0, -EINVAL (no
 * such topic, or more than 65535 channels), as bag_writer_message. */
int bag_topics_put(struct bag_topics *t, const struct envelope *e, const void *payload,
                   uint16_t *channel_id, struct error *why);
void bag_topics_destroy(struct bag_topics *t);

/* What a channel of a bag says of all its messages. */
struct bag_source {
    const struct topic *topic;
    char node[ENVELOPE_NODE_SIZE];
    int64_t epoch_ns;
    bool captured;
};

/* A message of the bus as one of a bag, but for its channel, which is of that source;
 * topic NULL: there is none of that name.  m borrows the payload. */
void bag_source_from(struct bag_source *source, struct bag_message *m,
                     const struct envelope *e, const void *payload);
bool bag_source_is_same(const struct bag_source *a, const struct bag_source *b);

/* Appends a channel's metadata. */
void bag_source_describe(const struct bag_source *s, struct bytes_buffer *metadata);

/* 0, -EINVAL (not written by bag_topics, or a topic of another version). */
int bag_source_of(struct bag_source *out, const struct bag_channel *channel);

/* The envelope with which the message went over the bus. */
void bag_source_envelope(const struct bag_source *s, const struct bag_message *m,
                         struct envelope *out);

#endif
