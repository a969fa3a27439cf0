/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/json_message.h -- JSON as a protobuf-c message: what message_json
 * writes, read back.  A field that is left out has its default; null is NaN of a number,
 * and no message of a message. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_JSON_MESSAGE_H
#define ANLOS_NODES_ANLOS_TOPIC_JSON_MESSAGE_H

#include <jansson.h>
#include <protobuf-c/protobuf-c.h>

#include "dsp/error.h"

/* Of an anlos.Tensor type and shape are asked for, and all numbers as data, complex ones
 * as [re, im]; min and max are ignored.  A Vec3 may be [x, y, z].  64-bit numbers may be
 * texts, enumerations names or numbers.  Free the result with
 * protobuf_c_message_free_unpacked(m, NULL).  0, -EINVAL (no such field, another type,
 * out of range: the error names the field), -ENOMEM. */
int json_message(ProtobufCMessage **out, const json_t *j,
                 const ProtobufCMessageDescriptor *schema, struct error *why);

#endif
