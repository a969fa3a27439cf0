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

/* The whole table, [TOPICS_COUNT]; ends with name == NULL. */
const struct topic *topics_all(void);

/* NULL: no such topic. */
const struct topic *topics_find(const char *name);

/* The names of all nodes; ends with NULL. */
const char *const *topics_nodes(void);
bool topics_have_node(const char *name);

/* The i-th publisher of a topic, "*" resolved to every node; NULL: no more. */
const char *topic_publisher(const struct topic *t, size_t i);
bool topic_is_published_by(const struct topic *t, const char *node);

/* clang-format off */
/* Name in code; of the topic; schema; expected rate in Hz; policy; depth; size; publishers.
 * A full queue of pings holds 4 s of a scan, one of traces a whole scan. */
#define TOPICS(X)                                                                        \
    X(survey, "survey", survey, 1, TOPIC_LATEST, 1, 16 * MB, "array")                    \
    X(stage_command, "stage/command", stage_command, 0, TOPIC_ALL, 16, 4 * KB, "scan")   \
    X(stage_state, "stage/state", stage_state, 2, TOPIC_LATEST, 1, 4 * KB, "stage")      \
    /* of "hand": a command line, no node */                                             \
    X(stage_manual, "stage/manual", stage_manual, 0, TOPIC_ALL, 16, 4 * KB, "hand")      \
    X(fire, "array/fire", fire_command, 0, TOPIC_ALL, 16, 64 * KB, "scan")               \
    X(ping, "ping", ping, 16, TOPIC_ALL, 64, 8 * MB, "array")                            \
    X(traces, "traces", traces, 16, TOPIC_ALL, 512, 8 * MB, "dsp")                       \
    X(volume, "volume", volume, 0, TOPIC_LATEST, 1, 256 * MB, "recon")                   \
    X(detections, "detections", detection_list, 0, TOPIC_ALL, 64, 1 * MB, "track")       \
    X(scan_status, "scan/status", scan_status, 5, TOPIC_LATEST, 1, 4 * KB, "scan")       \
    X(receipt, "receipt", receipt, 16, TOPIC_ALL, 4096, 4 * KB, "dsp", "recon")          \
    X(health, "health", health, 1, TOPIC_ALL, 256, 64 * KB, "*")                         \
    X(log, "log", log, 0, TOPIC_ALL, 512, 16 * KB, "*")                                  \
    X(clock, "clock", clock, 5, TOPIC_LATEST, 1, 8 * KB, "play")                         \
    /* of launchers of a system on several machines */                                   \
    X(host, "host", host_status, 2, TOPIC_ALL, 16, 4 * KB, "launcher")                   \
    X(wall, "wall", wall_list, 10, TOPIC_LATEST, 1, 16 * KB, "wall")                     \
    X(wall_given, "wall/given", wall_list, 10, TOPIC_LATEST, 1, 16 * KB,                 \
      "can", "vehicle")                                                                  \
    X(echoes, "echoes", echoes, 0, TOPIC_ALL, 256, 256 * KB, "dsp")                      \
    X(ego, "ego", ego_motion, 50, TOPIC_ALL, 256, 4 * KB, "can", "vehicle")              \
    X(ambient, "ambient", ambient, 1, TOPIC_LATEST, 1, 4 * KB, "can", "vehicle")         \
    X(places, "array/places", element_places, 0, TOPIC_LATEST, 1, 16 * KB, "dsp")        \
    /* in a replay only */                                                               \
    X(progress, "progress", progress, 0, TOPIC_ALL, 256, 4 * KB,                         \
      "play", "dsp", "recon", "wall", "track", "can", "report")                          \
    /* also of "hand", and "page": `anlos view` */                                       \
    X(save, "record/save", save_request, 0, TOPIC_ALL, 16, 4 * KB,                       \
      "hand", "view", "page", "can")                                                     \
    /* also of "recorder": `anlos bag record` */                                         \
    X(save_status, "record/status", save_status, 1, TOPIC_ALL, 64, 8 * KB,               \
      "record", "recorder")
/* clang-format on */

enum {
#define TOPICS_PLACE(name, ...) TOPICS_PLACE_##name,
    TOPICS(TOPICS_PLACE) TOPICS_COUNT
#undef TOPICS_PLACE
};

/* The topics by name, for code: topic_ping() is topics_find("ping"), never NULL. */
#define TOPICS_DECLARE(name, ...) const struct topic *topic_##name(void);
TOPICS(TOPICS_DECLARE)
#undef TOPICS_DECLARE

#endif
