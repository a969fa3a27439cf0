/* nodes/anlos/topic/message_line.h -- a message with its envelope as one line of JSON: as
 * `anlos topic echo` prints it and `anlos bag export --format json` writes it. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_MESSAGE_LINE_H
#define ANLOS_NODES_ANLOS_TOPIC_MESSAGE_LINE_H

#include <protobuf-c/protobuf-c.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "msgs/envelope.h"

struct message_line {
    const char *topic; /* [n_topic] */
    size_t n_topic;
    const struct envelope *envelope;
    size_t n_bytes;
    const ProtobufCMessage *content; /* NULL: then why_not tells */
    const char *why_not;
};

/* full: every number of sound and images (message_json).  0, -ENOMEM; what cannot be
 * written shows in ferror(f). */
int message_line_write(const struct message_line *l, bool full, FILE *f);

#endif
