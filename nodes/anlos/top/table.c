#include "nodes/anlos/top/table.h"

#include <math.h>
#include <string.h>

const char *table_node_state_name(enum table_node_state state)
{
    static const char *const names[] = {
        [TABLE_OFF] = "off",     [TABLE_STARTING] = "starting",
        [TABLE_READY] = "ready", [TABLE_DEGRADED] = "degraded",
        [TABLE_FAULT] = "fault", [TABLE_SILENT] = "silent",
        [TABLE_DEAD] = "dead",
    };
    return names[state];
}

const char *table_topic_state_name(enum table_topic_state state)
{
    static const char *const names[] = {
        [TABLE_ABSENT] = "-", [TABLE_IDLE] = "idle",     [TABLE_OK] = "ok",
        [TABLE_LOW] = "low",  [TABLE_LOSING] = "losing", [TABLE_CUT] = "dead",
    };
    return names[state];
}

bool table_is_of_pings(const struct topic *t)
{
    return t == topic_ping() || t == topic_traces() || t == topic_receipt();
}

/* The rate of a scan in steps. */
static double usual_hz(const struct topic *t, const char *node,
                       const struct table_scan *scan)
{
    bool background = scan->known && scan->pass == ANLOS__PASS__BACKGROUND;
    const char *idle = background ? "recon" : "dsp";

    if (background && t == topic_traces())
        return 0;
    if (t == topic_receipt() && node && !strcmp(node, idle))
        return 0;
    return t->rate_hz;
}

double table_expected_hz(const struct topic *t, const char *node,
                         const struct table_scan *scan)
{
    bool endless = scan->known && !scan->expected;

    return endless && table_is_of_pings(t) ? 0 : usual_hz(t, node, scan);
}

struct flow { /* of a topic, over the links of its nodes */
    uint64_t bytes, lost_lately;
    const struct table_link *best; /* of those that receive it, who had most */
};

static void add_publisher(struct table_topic *t, const struct table_node *node,
                          const struct table_link *link)
{
    t->known++;
    t->alive += table_node_is_alive(node);
    t->messages += link->messages;
    if (!isnan(link->rate_hz)) {
        t->rate_hz = (isnan(t->rate_hz) ? 0 : t->rate_hz) + link->rate_hz;
        t->bytes_s = (isnan(t->bytes_s) ? 0 : t->bytes_s) + link->bytes_s;
    }
    if (link->latency.n > t->latency.n)
        t->latency = link->latency;
}

static void add_link(struct table_topic *t, struct flow *f, const struct table_node *node,
                     const struct table_link *link)
{
    if (link->published) {
        add_publisher(t, node, link);
        f->bytes += link->bytes;
        return;
    }
    f->lost_lately += link->lost_lately;
    if (!f->best || link->messages > f->best->messages)
        f->best = link;
    t->lost += link->gaps + link->dropped;
    if (link->queued > t->queued)
        t->queued = link->queued;
}

/* Published by none that tells of its health: a bag that is played, a command line. */
static void take_from_receiver(struct table_topic *t, struct flow *f)
{
    t->rate_hz = f->best->rate_hz;
    t->bytes_s = f->best->bytes_s;
    t->messages = f->best->messages;
    t->latency = f->best->latency;
    f->bytes = f->best->bytes;
}

static bool scan_runs(const struct table *t)
{
    return t->scan.known && !t->scan.over &&
           t->scan.state == ANLOS__SCAN_STATUS__STATE__RUNNING;
}

static enum table_topic_state judge(const struct table_topic *t, uint64_t lost_lately,
                                    double usual_hz, bool runs)
{
    if (!t->known && !t->messages)
        return TABLE_ABSENT;
    if (t->known && !t->alive)
        return TABLE_CUT;
    if (lost_lately)
        return TABLE_LOSING;
    if (runs && t->messages && t->rate_hz < usual_hz / 4)
        return TABLE_LOW;
    return t->rate_hz > 0 ? TABLE_OK : TABLE_IDLE;
}

static void fill_topic(const struct table *table, struct table_topic *t)
{
    struct flow flow = {0};
    bool of_every_node = !strcmp(t->topic->publishers[0], "*");

    for (size_t i = 0; i < table->n_nodes; i++)
        for (size_t k = 0; k < table->nodes[i].n_links; k++)
            if (table->nodes[i].links[k].topic == t->topic)
                add_link(t, &flow, &table->nodes[i], &table->nodes[i].links[k]);
    if (!t->known && flow.best)
        take_from_receiver(t, &flow);
    t->size_bytes = t->messages ? (double)flow.bytes / (double)t->messages : NAN;
    double publishers = of_every_node ? t->alive : 1;
    t->expected_hz = publishers * table_expected_hz(t->topic, NULL, &table->scan);
    t->state = judge(t, flow.lost_lately,
                     publishers * usual_hz(t->topic, NULL, &table->scan),
                     scan_runs(table));
}

void table_fill_topics(struct table *t)
{
    t->n_topics = 0;
    for (const struct topic *topic = topics_all(); topic->name; topic++) {
        if (t->n_topics == TABLE_MAX_TOPICS)
            break;
        struct table_topic *row = &t->topics[t->n_topics++];
        *row = (struct table_topic){.topic = topic, .rate_hz = NAN, .bytes_s = NAN};
        fill_topic(t, row);
    }
}
