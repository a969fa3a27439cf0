/* SPDX-License-Identifier: MIT */
/* nodes/rt/log_topic.h -- the lines of a node's log on the bus, topic "log", at a bounded
 * rate: a fault in a loop must not take the bus from those who work. */
#ifndef ANLOS_NODES_RT_LOG_TOPIC_H
#define ANLOS_NODES_RT_LOG_TOPIC_H

#include "msgs/bus.h"
#include "nodes/rt/log.h"

enum { LOG_TOPIC_BURST = 50, LOG_TOPIC_RATE_HZ = 10, LOG_TOPIC_HELD = 16 };

#define LOG_TOPIC_HOLD_NS 1000000000LL

struct log_topic {
    struct bus *bus;
    double room; /* lines that may be sent now */
    int64_t at_ns;
    uint64_t left_out;
    int64_t start_ns;
    size_t n_held;
    struct log_line held[LOG_TOPIC_HELD];
};

/* From now on each line of the log goes out on the bus too, whose node publishes "log".
 * Those of the first second wait until it is over: those who listen, a recorder that was
 * started together with this node among them, are connected by then.  log_topic_stop it
 * before the bus is destroyed. */
void log_topic_start(struct log_topic *t, struct log *log, struct bus *bus,
                     int64_t now_ns);
void log_topic_stop(struct log_topic *t, struct log *log);

/* Sends what waits. */
void log_topic_flush(struct log_topic *t);

/* Sends a line, or leaves it out: log_on_line's call, ctx a struct log_topic.  A line
 * without text only sends how many were left out, when some were and there is room. */
void log_topic_send(void *ctx, const struct log_line *line);

#endif
