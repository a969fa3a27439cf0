/* SPDX-License-Identifier: MIT */
/* tests/e2e/hear.h -- waits for what a system of real processes says. */
#ifndef ANLOS_TESTS_E2E_HEAR_H
#define ANLOS_TESTS_E2E_HEAR_H

#include <string.h>

#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/topics.h"

#define HEAR_NS 60000000000LL /* on a busy machine */

/* The next message of a topic, to be freed; of a node or, NULL, of any; one that was
 * published since then.  NULL: none came in HEAR_NS. */
static inline ProtobufCMessage *hear_on(struct bus *bus, const struct topic *topic,
                                        const char *node, int64_t since_ns)
{
    int64_t end_ns = clock_now_ns(clock_system()) + HEAR_NS;
    struct bus_message in;

    while (clock_now_ns(clock_system()) < end_ns) {
        if (bus_receive(bus, &in, 500))
            continue;
        bool wanted = in.topic == topic && in.envelope.publish_ns >= since_ns &&
                      (!node || !strcmp(in.envelope.node, node));
        ProtobufCMessage *m = wanted ? bus_message_unpack(&in) : NULL;
        bus_message_free(&in);
        if (m)
            return m;
    }
    return NULL;
}

#endif
