/* nodes/anlos/top/table.h -- what `anlos top` shows, as numbers: made by the collector,
 * read by the layout.  A rate or a share that is not known yet is NAN. */
#ifndef ANLOS_NODES_ANLOS_TOP_TABLE_H
#define ANLOS_NODES_ANLOS_TOP_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/device_count.h"
#include "msgs/detections.pb-c.h"
#include "msgs/envelope.h"
#include "msgs/scan.pb-c.h"
#include "msgs/topics.h"
#include "nodes/rt/priority.h"

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
    bool published; /* else received */
    double rate_hz, bytes_s;
    double expected_hz; /* 0: now and then */
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

/* Messages a second that a node publishes of the topic while a scan runs, node NULL: all
 * its publishers together.  Less than in msgs/topics.h where a pass does without:
 * background pings end in dsp, scene pings in recon (msgs/scan.proto).  0 of the pings of
 * an array that stands, and what comes of them: they come at the pace of its slots. */
double table_expected_hz(const struct topic *t, const char *node,
                         const struct table_scan *scan);

/* Is it a ping, or what is made of each? */
bool table_is_of_pings(const struct topic *t);

/* Sums the topics up from the nodes and the scan. */
void table_fill_topics(struct table *t);

const char *table_node_state_name(enum table_node_state state);
const char *table_topic_state_name(enum table_topic_state state);

static inline bool table_node_is_alive(const struct table_node *n)
{
    return n->state != TABLE_OFF && n->state != TABLE_DEAD;
}

#endif
