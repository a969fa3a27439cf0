/* SPDX-License-Identifier: MIT */
/* msgs/bus_message.h -- a message as it came in over the bus. */
#ifndef ANLOS_MSGS_BUS_MESSAGE_H
#define ANLOS_MSGS_BUS_MESSAGE_H

#include <protobuf-c/protobuf-c.h>
#include <stdint.h>

#include "msgs/envelope.h"
#include "msgs/topics.h"

/* It owns its payload; bus_message_free it. */
struct bus_message {
    const struct topic *topic;
    struct envelope envelope;
    const uint8_t *payload; /* [envelope.payload_size] */
    void *owner;            /* the bus's own */
};

/* Frees what m owns and zeroes it; a zeroed one may be freed too. */
void bus_message_free(struct bus_message *m);

/* Unpacks the payload by the topic's schema.  NULL and errno: as message_unpack
 * (msgs/unpack.h).  Free the result with protobuf_c_message_free_unpacked(m, NULL). */
ProtobufCMessage *bus_message_unpack(const struct bus_message *m);

#endif
