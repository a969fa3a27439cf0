/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/field_path.h -- one field of a message: "position_m", or
 * "detections.0.position_m.x"; without a number that of each: "detections.existence". */
#ifndef ANLOS_NODES_ANLOS_TOPIC_FIELD_PATH_H
#define ANLOS_NODES_ANLOS_TOPIC_FIELD_PATH_H

#include <jansson.h>
#include <protobuf-c/protobuf-c.h>

#include "dsp/error.h"

/* Does a message of the schema have it?  0, -EINVAL: the error says what there is. */
int field_path_check(const char *path, const ProtobufCMessageDescriptor *schema,
                     struct error *why);

/* What message_json made of it, as a new reference; null where there is none: an index
 * beyond the end, a message that is absent.  NULL: no memory. */
json_t *field_path_pick(const char *path, json_t *content);

#endif
