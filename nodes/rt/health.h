/* SPDX-License-Identifier: MIT */
/* nodes/rt/health.h -- what a process says about itself in its health message. */
#ifndef ANLOS_NODES_RT_HEALTH_H
#define ANLOS_NODES_RT_HEALTH_H

#include <stddef.h>

#include "hal/device_count.h"
#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "nodes/rt/latencies.h"

#define HEALTH_MAX_TOPICS 64

#define HEALTH_MAX_FAULTS 16

struct health_fault { /* of a node that works: so many of so many */
    const char *name;
    uint32_t count, of;
};

struct health_faults { /* what a message points to */
    Anlos__Fault faults[HEALTH_MAX_FAULTS];
    Anlos__Fault *list[HEALTH_MAX_FAULTS];
};

struct health { /* the message and what it points to */
    Anlos__Health message;
    Anlos__TopicCount counts[HEALTH_MAX_TOPICS];
    Anlos__TopicCount *count_list[HEALTH_MAX_TOPICS];
    Anlos__DeviceCount device[DEVICE_MAX_COUNTS];
    Anlos__DeviceCount *device_list[DEVICE_MAX_COUNTS];
};

/* Fills in everything but state, text and uptime_s.  malformed: messages that were whole
 * but did not unpack, counted as refused. */
void health_take(struct health *out, struct bus *bus, char *node, uint64_t malformed);

/* Adds how old the sound is in what the node takes and publishes. */
void health_latencies(struct health *out, const struct latencies *l, int64_t now_ns);

/* Adds what the node's device counts. */
void health_device(struct health *out, const struct device_count *counts, size_t n);

/* Lets the message say them; both have to stay where they are.  n: up to
 * HEALTH_MAX_FAULTS. */
void health_faults(Anlos__Health *message, struct health_faults *out,
                   const struct health_fault *faults, size_t n);

#endif
