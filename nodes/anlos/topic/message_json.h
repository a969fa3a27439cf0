/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/message_json.h -- any protobuf-c message as JSON, by its descriptor,
 * in proto3's own mapping (64-bit integers as strings, enums by name, NaN as null), but
 * with the field names of the schema and every field written. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_MESSAGE_JSON_H
#define ANLOS_NODES_ANLOS_TOPIC_MESSAGE_JSON_H

#include <jansson.h>
#include <protobuf-c/protobuf-c.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "msgs/envelope.h"

/* An anlos.Tensor becomes type, shape, min and max (of the magnitude when complex); full:
 * its numbers too, complex ones as [re, im].  Other bytes become their size; full: hex.
 * NULL: no memory. */
json_t *message_json(const ProtobufCMessage *m, bool full);

/* Bytes of one value of a field that repeats, in protobuf-c's array of them. */
size_t message_value_size(ProtobufCType type);

/* A message with its envelope as one line of JSON: as `anlos topic echo` prints it and
 * `anlos bag export --format json` writes it. */

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
