/* SPDX-License-Identifier: MIT */
/* nodes/anlos/collector.h -- gathers what the processes of a system say of themselves
 * into one table: for `anlos top`, `anlos node` and `anlos doctor`.  Pure: messages and
 * times come in, a table goes out.  Rates and shares are those of the last three seconds,
 * by the clock of whoever listens; a process that starts again counts anew.  A rate or a
 * share that is not known yet is NAN. */
#ifndef ANLOS_NODES_ANLOS_COLLECTOR_H
#define ANLOS_NODES_ANLOS_COLLECTOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/device.h"
#include "msgs/detections.pb-c.h"
#include "msgs/envelope.h"
#include "msgs/health.pb-c.h"
#include "msgs/log.pb-c.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "nodes/rt/process.h"
#include "nodes/rt/rundir.h"

#define COLLECTOR_SILENT_NS                                                              \
    2500000000LL /* two health messages and a half are missing                           \
                  */

enum {
    TABLE_MAX_NODES = 32,
    TABLE_MAX_TOPICS = 48,
    TABLE_MAX_LINKS = 32,
    TABLE_MAX_DEVICE = DEVICE_MAX_COUNTS,
    TABLE_MAX_LOGS = 64,
    TABLE_MAX_OBJECTS = 64,
    TABLE_TEXT_SIZE = 256,
};

enum table_node_state {
    TABLE_OFF, /* ran in this folder before anybody looked */
    TABLE_STARTING,
    TABLE_READY,
    TABLE_DEGRADED,
    TABLE_FAULT,
    TABLE_SILENT, /* the process lives and says nothing: busy for long, or hung */
    TABLE_DEAD,
};

struct table_latency { /* from the capture stamp, over the last seconds */
    unsigned n;        /* messages; 0: not known */
    double median_s, p99_s;
};

struct table_link { /* a topic at a node */
    const struct topic *topic;
    bool published;              /* else received */
    double rate_hz, expected_hz; /* expected 0: now and then */
    double bytes_s;
    uint64_t messages, bytes, gaps, dropped;
    uint64_t lost_lately; /* gaps and drops within the window of the rate */
    uint32_t queued;
    struct table_latency latency;
};

struct table_device {
    char name[48];
    uint64_t value;
};

struct table_node {
    char name[ENVELOPE_NODE_SIZE];
    enum table_node_state state;
    enum presence presence;     /* of its lock, here */
    char text[TABLE_TEXT_SIZE]; /* what it says of itself */
    char priority[PRIORITY_TEXT_SIZE];
    uint32_t pid;
    unsigned restarts; /* since we look */
    bool twin;         /* an older process of this name speaks too, on another machine */
    double silent_s;   /* since it was heard; NAN: never */
    double uptime_s, cpu; /* cpu: 1 is one core */
    uint64_t rss_bytes, refused, refused_connections;
    size_t n_links, n_device;
    struct table_link links[TABLE_MAX_LINKS];
    struct table_device device[TABLE_MAX_DEVICE];
    /* The sum of its links, and the one that tells best how it works. */
    uint64_t queued, dropped, gaps;
    double in_hz, out_hz;
    double rate_hz, expected_hz; /* expected 0: now and then */
    struct table_latency latency;
};

enum table_topic_state {
    TABLE_ABSENT, /* nobody publishes or receives it */
    TABLE_IDLE,   /* nothing comes, and nothing need come now */
    TABLE_OK,
    TABLE_LOW, /* it flowed; now under a quarter of what is expected while a scan runs */
    TABLE_LOSING, /* messages got lost just now */
    TABLE_CUT,    /* its publishers are dead */
};

struct table_topic {
    const struct topic *topic;
    enum table_topic_state state;
    unsigned alive, known; /* publishers */
    double rate_hz, expected_hz, bytes_s, size_bytes;
    uint64_t messages, lost, queued; /* queued: in the fullest queue */
    struct table_latency latency;
};

struct table_scan {
    bool known;
    bool over; /* its process is gone: this is its last word */
    Anlos__ScanStatus__State state;
    Anlos__Pass pass;
    uint32_t scan, position, done, expected, retaken, given_up;
    double left_s;
    char text[TABLE_TEXT_SIZE];
};

struct table_object { /* NAN: not known */
    uint32_t id;
    Anlos__Measurement measurement;
    Anlos__Shape shape;
    bool in_vehicle_frame; /* else the array's */
    bool mirrored;         /* else where it is imaged */
    double at_m[3], velocity_m_s[2], existence;
    double age_s, unseen_s; /* of tracks */
};

struct table_objects { /* of the newest list */
    bool known;
    bool over; /* its process is gone: this is its last word */
    size_t n;
    struct table_object list[TABLE_MAX_OBJECTS];
};

struct table_log {
    int64_t stamp_ns;
    char level[8];
    char node[ENVELOPE_NODE_SIZE];
    char text[TABLE_TEXT_SIZE];
    uint64_t repeats;  /* times more */
    uint64_t left_out; /* lines before it that never came */
};

struct table {
    char run_dir[112];
    size_t n_nodes, n_topics, n_logs;
    struct table_node nodes[TABLE_MAX_NODES];
    struct table_topic topics[TABLE_MAX_TOPICS];
    struct table_log logs[TABLE_MAX_LOGS]; /* the newest last */
    struct table_scan scan;
    struct table_objects objects;
    uint64_t lost;        /* messages over all nodes, as they count them */
    double own_cpu;       /* of this program; 1 is one core */
    uint64_t own_refused; /* messages that it could not read */
};

const char *table_node_state_name(enum table_node_state state);
const char *table_topic_state_name(enum table_topic_state state);

static inline bool table_node_is_alive(const struct table_node *n)
{
    return n->state != TABLE_OFF && n->state != TABLE_DEAD;
}

/* NULL: nothing is known of it. */
const struct table_node *table_find(const struct table *t, const char *node);

/* Is it a ping, or what is made of each? */
bool table_is_of_pings(const struct topic *t);

/* Sums the topics up from the nodes and the scan. */
void table_fill_topics(struct table *t);

struct collector;

/* 0, -ENOMEM. */
int collector_create(struct collector **out);

/* epoch_ns: when the sender started (envelope). */
void collector_health(struct collector *c, const Anlos__Health *m, int64_t epoch_ns,
                      int64_t now_ns);
void collector_scan(struct collector *c, const Anlos__ScanStatus *m);
void collector_objects(struct collector *c, const Anlos__DetectionList *m);
void collector_log(struct collector *c, const Anlos__Log *m);

/* What the run folder tells of a node. */
void collector_presence(struct collector *c, const char *node, enum presence presence,
                        int64_t now_ns);

/* Rows in the order of msgs/topics.h; what is not of the system (run_dir, own_cpu,
 * own_refused) is left alone. */
void collector_table(const struct collector *c, int64_t now_ns, struct table *out);
void collector_destroy(struct collector *c);

#endif
