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

#include "dsp/error.h"
#include "msgs/envelope.h"

/* An anlos.Tensor becomes type, shape, min and max (of the magnitude when complex); full:
 * its numbers too, complex ones as [re, im].  Other bytes become their size; full: hex.
 * NULL: no memory. */
json_t *message_json(const ProtobufCMessage *m, bool full);

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

/* And back: what message_json writes with full.  A field that is left out has its
 * default; null is NaN of a number, and no message of a message. */

/* Of an anlos.Tensor type and shape are asked for, and all numbers as data, complex ones
 * as [re, im]; min and max are ignored.  A Vec3 may be [x, y, z].  64-bit numbers may be
 * texts, enumerations names or numbers.  Free the result with
 * protobuf_c_message_free_unpacked(m, NULL).  0, -EINVAL (no such field, another type,
 * out of range: the error names the field), -ENOMEM. */
int json_message(ProtobufCMessage **out, const json_t *j,
                 const ProtobufCMessageDescriptor *schema, struct error *why);

/* One field of a message: "position_m", or "detections.0.position_m.x"; without a number
 * that of each: "detections.existence". */

/* Does a message of the schema have it?  0, -EINVAL: the error says what there is. */
int field_path_check(const char *path, const ProtobufCMessageDescriptor *schema,
                     struct error *why);

/* What message_json made of it, as a new reference; null where there is none: an index
 * beyond the end, a message that is absent.  NULL: no memory. */
json_t *field_path_pick(const char *path, json_t *content);

#endif
