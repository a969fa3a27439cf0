/* SPDX-License-Identifier: MIT */
/* msgs/topics.h -- every topic, in one table that nodes, tools and tests all read. */
#ifndef ANLOS_MSGS_TOPICS_H
#define ANLOS_MSGS_TOPICS_H

#include <protobuf-c/protobuf-c.h>
#include <stdbool.h>
#include <stddef.h>

enum topic_policy {
    TOPIC_ALL,    /* keep every message up to the depth; then the oldest goes, counted */
    TOPIC_LATEST, /* a new message replaces the one that waits, and takes its own turn:
                   * state, not events */
};

struct topic {
    const char *name;
    const ProtobufCMessageDescriptor *schema;
    double rate_hz; /* expected while a scan runs; 0: now and then */
    enum topic_policy policy;
    size_t depth;              /* messages that may wait in a subscriber's queue */
    size_t max_size;           /* payload bytes; larger ones are refused */
    const char *publishers[8]; /* node names, NULL at the end; {"*"}: every node */
};

/* The whole table; ends with name == NULL. */
const struct topic *topics_all(void);

/* NULL: no such topic. */
const struct topic *topics_find(const char *name);

/* The names of all nodes; ends with NULL. */
const char *const *topics_nodes(void);
bool topics_have_node(const char *name);

/* The i-th publisher of a topic, "*" resolved to every node; NULL: no more. */
const char *topic_publisher(const struct topic *t, size_t i);
bool topic_is_published_by(const struct topic *t, const char *node);

/* The topics by name, for code: topic_ping() is topics_find("ping"), never NULL. */
const struct topic *topic_survey(void);
const struct topic *topic_stage_command(void);
const struct topic *topic_stage_state(void);
const struct topic *topic_stage_manual(void); /* of "hand": a command line, no node */
const struct topic *topic_fire(void);
const struct topic *topic_ping(void);
const struct topic *topic_traces(void);
const struct topic *topic_volume(void);
const struct topic *topic_detections(void);
const struct topic *topic_scan_status(void);
const struct topic *topic_receipt(void);
const struct topic *topic_health(void);
const struct topic *topic_log(void);
const struct topic *topic_clock(void);
const struct topic *topic_host(void); /* of launchers of a system on several machines */
const struct topic *topic_wall(void);
const struct topic *topic_wall_given(void);
const struct topic *topic_echoes(void);
const struct topic *topic_ego(void);
const struct topic *topic_ambient(void);
const struct topic *topic_places(void);
const struct topic *topic_progress(void); /* in a replay only */
const struct topic *topic_save(void);     /* also of "hand", and "page": `anlos view` */
const struct topic *topic_save_status(void); /* also of "recorder": `anlos bag record` */

#endif
