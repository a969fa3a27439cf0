/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/stream.h -- the messages of some topics of a bag, in the order of their
 * times, as the bus would have brought them. */
#ifndef ANLOS_NODES_ANLOS_BAG_STREAM_H
#define ANLOS_NODES_ANLOS_BAG_STREAM_H

#include "msgs/bag/cursor.h"
#include "msgs/bag/topic_message.h"

struct stream;

struct stream_message {
    const struct bag_channel *channel;
    const struct topic
        *topic; /* NULL: not one of ours; then the envelope has times only */
    struct envelope envelope;
    struct bytes payload;   /* until the next one */
    struct bag_message raw; /* the same as it is in the bag */
};

/* All topics.  0, as bag_catalog_open. */
int stream_open(struct stream **out, const char *path, struct error *why);

/* Does each pattern (verb_matches) match a topic of the bag?  0, -EINVAL: one does not;
 * the error says which. */
int stream_require(const struct stream *s, const char *topics, struct error *why);

/* Only what the patterns match; to be said before the first stream_next. */
void stream_select(struct stream *s, const char *topics);

/* What it reads; as long as the stream. */
const struct bag_catalog *stream_catalog(const struct stream *s);

/* From the first message again. */
void stream_rewind(struct stream *s);

/* 0, -ENODATA (the end), -EINTR (Ctrl-C), -EBADMSG (of no channel), as bag_cursor_next.
 */
int stream_next(struct stream *s, struct stream_message *out, struct error *why);

/* The content by the topic's schema; free it with protobuf_c_message_free_unpacked.  0,
 * -EBADMSG (it is not one, or of no topic of ours), -ENOMEM; *out is NULL then. */
int stream_unpack(ProtobufCMessage **out, const struct stream *s,
                  const struct stream_message *m, struct error *why);
void stream_close(struct stream *s);

#endif
