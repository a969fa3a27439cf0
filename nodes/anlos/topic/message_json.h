/* nodes/anlos/topic/message_json.h -- any protobuf-c message as JSON, by its descriptor,
 * in proto3's own mapping (64-bit integers as strings, enums by name, NaN as null), but
 * with the field names of the schema and every field written. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_MESSAGE_JSON_H
#define ANLOS_NODES_ANLOS_TOPIC_MESSAGE_JSON_H

#include <jansson.h>
#include <protobuf-c/protobuf-c.h>
#include <stdbool.h>

/* An anlos.Tensor becomes type, shape, min and max (of the magnitude when complex); full:
 * its numbers too, complex ones as [re, im].  Other bytes become their size; full: hex.
 * NULL: no memory. */
json_t *message_json(const ProtobufCMessage *m, bool full);

#endif
