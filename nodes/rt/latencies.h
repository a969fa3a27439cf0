/* SPDX-License-Identifier: MIT */
/* nodes/rt/latencies.h -- how old the sound is in the messages that a node takes and
 * publishes: from the capture stamp, topic by topic, over the last seconds. */
#ifndef ANLOS_NODES_RT_LATENCIES_H
#define ANLOS_NODES_RT_LATENCIES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/topics.h"

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

#endif
