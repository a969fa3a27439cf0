/* SPDX-License-Identifier: MIT */
/* nodes/rt/health.h -- what a process says about itself in its health messages; of a node
 * once a second, at each change of its state, and when somebody begins to listen.  A
 * node's come from the main loop and count its turns, so that the launcher sees whether
 * it stands still. */
#ifndef ANLOS_NODES_RT_HEALTH_H
#define ANLOS_NODES_RT_HEALTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/clock.h"
#include "hal/device.h"
#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "nodes/rt/log.h"
#include "nodes/rt/process.h"

/* How old the sound is in the messages that a node takes and publishes: from the capture
 * stamp, topic by topic, over the last seconds. */

#define LATENCIES_MAX_TOPICS 16
#define LATENCIES_DEPTH      256 /* the newest of each topic */
#define LATENCIES_WINDOW_NS  5000000000LL

struct latency_sample {
    int64_t at_ns; /* when it was measured */
    double s;
};

struct latencies { /* zeroed: empty */
    size_t n;
    struct latency_track {
        const struct topic *topic;
        bool published; /* else received */
        size_t n;       /* ever added; the newest stands at (n - 1) % LATENCIES_DEPTH */
        struct latency_sample ring[LATENCIES_DEPTH];
    } tracks[LATENCIES_MAX_TOPICS];
};

struct latency_summary {
    size_t n;               /* messages in the window; 0: the rest is 0 too */
    double median_s, p99_s; /* nearest rank */
};

/* A message is taken or published at now_ns.  capture_ns 0, of no sound, is ignored.
 */
void latencies_add(struct latencies *l, const struct topic *t, bool published,
                   int64_t now_ns, int64_t capture_ns);

struct latency_summary latencies_summarise(const struct latencies *l,
                                           const struct topic *t, bool published,
                                           int64_t now_ns);

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

/* Adds what the node's device counts. */
void health_device(struct health *out, const struct device_count *counts, size_t n);

/* Lets the message say them; both have to stay where they are.  n: up to
 * HEALTH_MAX_FAULTS. */
void health_faults(Anlos__Health *message, struct health_faults *out,
                   const struct health_fault *faults, size_t n);

struct heartbeat {
    char *node; /* whose, not owned; bus, log and clock neither */
    struct bus *bus;
    struct log *log;
    const struct clock_replay *clock;
    int64_t epoch_ns;
    int64_t due_ns, look_due_ns;
    size_t peers; /* connected, as health said last */
    Anlos__Health__State state;
    char text[256];
    uint64_t malformed; /* messages that did not unpack */
    struct latencies latencies;
    size_t (*counts)(void *device, struct device_count *out);
    void *device;                                  /* NULL: none */
    struct health_fault faults[HEALTH_MAX_FAULTS]; /* [n_faults], those that last */
    size_t n_faults;
    char priority[PRIORITY_TEXT_SIZE]; /* of this process */
    uint64_t turns;                    /* of the main loop, so far */
    double turn_limit_s;           /* each may take so long; 0: as the launcher has it */
    double busy_s;                 /* the one under way; 0: as any */
    bool ended;                    /* what it plays */
    const Anlos__Sensing *sensing; /* not owned; NULL: none */
};

/* Says how the node is if it is time to, and tells of repeated lines in its log.  now_ns,
 * here and of what it returns: the machine's. Returns when to ask again. */
int64_t heartbeat_tick(struct heartbeat *h, int64_t now_ns);

/* The main loop comes around: what it was busy with is done. */
void heartbeat_turn(struct heartbeat *h);

/* What follows until it comes around may take so long; said at once. */
void heartbeat_busy(struct heartbeat *h, double limit_s);

/* Sets the state and says so at once when it changed; one that is worse is logged. */
void heartbeat_state(struct heartbeat *h, Anlos__Health__State state, const char *text);

/* Sets how many of so many have the fault, 0: none, and says so at once when it changed.
 * name: a literal. */
void heartbeat_fault(struct heartbeat *h, const char *name, uint32_t count, uint32_t of);

/* Does a node keep up?  Whoever is late leaves some of its work out, counts it, and says
 * so when that is more than a moment's load. */

#define PACE_LOOK_NS                                                                     \
    INT64_C(1000000000) /* from one look at what was skipped to the next */
#define PACE_LATE 0.1   /* share skipped since the last look: late */

struct pace { /* {0}: nothing yet */
    uint64_t done, skipped;
    int64_t due_ns; /* of the next look */
    uint64_t then_done, then_skipped;
    bool late;
};

/* The machine's clock. */
bool pace_is_late(struct pace *p, int64_t now_ns);

#endif
