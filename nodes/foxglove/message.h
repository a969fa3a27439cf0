/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/message.h -- a message of the bus or of a bag, as it is given to
 * Foxglove.
 */
#ifndef ANLOS_NODES_FOXGLOVE_MESSAGE_H
#define ANLOS_NODES_FOXGLOVE_MESSAGE_H

#include <protobuf-c/protobuf-c.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/topics.h"

/* It borrows all that it points to. */
struct foxglove_message {
    const struct topic *topic;
    const char *node;                /* who published it */
    const ProtobufCMessage *content; /* by the topic's schema */
    const uint8_t *payload;          /* [payload_size] the content as it came; NULL: it is
                                      * packed again when it is needed */
    size_t payload_size;
    int64_t capture_ns; /* 0: of no sound */
    int64_t publish_ns;
};

#endif
