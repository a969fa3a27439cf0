/* SPDX-License-Identifier: MIT */
/* tests/nodes/health.h -- health messages made by hand, for the tests of what reads them.
 */
#ifndef ANLOS_TESTS_NODES_HEALTH_H
#define ANLOS_TESTS_NODES_HEALTH_H

#include "hal/device.h"
#include "msgs/health.pb-c.h"

/* More of a device's counts than a process may have. */
enum { HEALTH_MAX_TOPICS = 48, HEALTH_MAX_DEVICE = DEVICE_MAX_COUNTS + 8 };

struct health { /* the message and what it points to */
    Anlos__Health message;
    Anlos__TopicCount counts[HEALTH_MAX_TOPICS], *count_list[HEALTH_MAX_TOPICS];
    Anlos__DeviceCount device[HEALTH_MAX_DEVICE], *device_list[HEALTH_MAX_DEVICE];
};

static inline struct health *health_begin(struct health *h, const char *node)
{
    anlos__health__init(&h->message);
    h->message.node = (char *)node;
    h->message.text = "at work";
    h->message.state = ANLOS__HEALTH__STATE__READY;
    h->message.pid = 77;
    h->message.topics = h->count_list;
    h->message.device = h->device_list;
    return h;
}

static inline Anlos__TopicCount *health_topic(struct health *h, const char *topic,
                                              int published, uint64_t messages)
{
    size_t i = h->message.n_topics++;
    Anlos__TopicCount *c = h->count_list[i] = &h->counts[i];
    anlos__topic_count__init(c);
    c->topic = (char *)topic;
    c->published = published;
    c->messages = messages;
    return c;
}

static inline void health_device(struct health *h, const char *name, uint64_t value)
{
    size_t i = h->message.n_device++;
    Anlos__DeviceCount *c = h->device_list[i] = &h->device[i];
    anlos__device_count__init(c);
    c->name = (char *)name;
    c->value = value;
}

#endif
