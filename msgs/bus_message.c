/* SPDX-License-Identifier: MIT */
#include "msgs/bus_message.h"

#include <nanomsg/nn.h>
#include <string.h>

#include "msgs/unpack.h"

void bus_message_free(struct bus_message *m)
{
    if (m->owner)
        nn_freemsg(m->owner);
    memset(m, 0, sizeof *m);
}

ProtobufCMessage *bus_message_unpack(const struct bus_message *m)
{
    return message_unpack(m->topic->schema, m->envelope.payload_size, m->payload);
}
