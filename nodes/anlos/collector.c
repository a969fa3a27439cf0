/* SPDX-License-Identifier: MIT */
#include "nodes/anlos/collector.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
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

/* Messages a second that a node publishes of the topic while a scan runs, node NULL: all
 * its publishers together.  Less than in msgs/topics.h where a pass does without:
 * background pings end in dsp, scene pings in recon (msgs/scan.proto).  0 of the pings of
 * an array that stands, and what comes of them: they come at the pace of its slots. */
static double expected_hz(const struct topic *t, const char *node,
                          const struct table_scan *scan)
{
    bool endless = scan->known && !scan->expected;

    return endless && table_is_of_pings(t) ? 0 : usual_hz(t, node, scan);
}

/* -- what a process had counted at times of the last seconds ----------------------------
 */

enum { HISTORY_DEPTH = 8 };

#define HISTORY_SPACING_NS                                                               \
    450000000LL                        /* a node that changes its state says so at once  \
                                        */
#define HISTORY_WINDOW_NS 3500000000LL /* three of the usual second, and their jitter */

struct history_sample {
    int64_t at_ns;
    double cpu_s;
    struct {
        uint64_t messages, bytes, lost;
    } links[TABLE_MAX_LINKS];
};

struct history { /* zeroed: empty */
    size_t n;    /* ever added; the newest stands at (n - 1) % HISTORY_DEPTH */
    struct history_sample ring[HISTORY_DEPTH];
};

/* A sample that follows the last one within HISTORY_SPACING_NS is ignored. */
static void history_add(struct history *h, const struct history_sample *s)
{
    const struct history_sample *last =
        &h->ring[(h->n + HISTORY_DEPTH - 1) % HISTORY_DEPTH];

    if (!h->n || s->at_ns - last->at_ns >= HISTORY_SPACING_NS)
        h->ring[h->n++ % HISTORY_DEPTH] = *s;
}

/* The oldest sample within the window of the newest. */
static const struct history_sample *find_base(const struct history *h,
                                              const struct history_sample *newest)
{
    size_t held = h->n < HISTORY_DEPTH ? h->n : HISTORY_DEPTH;

    for (size_t age = held - 1; age > 0; age--) {
        const struct history_sample *s = &h->ring[(h->n - 1 - age) % HISTORY_DEPTH];
        if (newest->at_ns - s->at_ns <= HISTORY_WINDOW_NS)
            return s;
    }
    return NULL;
}

static void link_rates(struct table_link *link, uint64_t messages, uint64_t bytes,
                       uint64_t lost, double span_s)
{
    link->rate_hz = (double)messages / span_s;
    link->bytes_s = (double)bytes / span_s;
    link->lost_lately = lost;
}

/* Writes into the node what has changed since the oldest sample of the window, links in
 * the order of the samples'. */
static void history_rates(const struct history *h, struct table_node *node)
{
    const struct history_sample *newest = NULL, *base = NULL;

    node->cpu = NAN;
    for (size_t i = 0; i < node->n_links; i++)
        link_rates(&node->links[i], 0, 0, 0, NAN);
    if (h->n) {
        newest = &h->ring[(h->n - 1) % HISTORY_DEPTH];
        base = find_base(h, newest);
    }
    if (!base)
        return;
    double span_s = 1e-9 * (double)(newest->at_ns - base->at_ns);
    node->cpu = (newest->cpu_s - base->cpu_s) / span_s;
    for (size_t i = 0; i < node->n_links; i++)
        link_rates(&node->links[i], newest->links[i].messages - base->links[i].messages,
                   newest->links[i].bytes - base->links[i].bytes,
                   newest->links[i].lost - base->links[i].lost, span_s);
}

/* -- a node: what it said last, and whether its process lives
 * ----------------------------
 */

struct member {
    struct table_node row; /* counts and text; the rest is filled in member_row */
    Anlos__Health__State state;
    bool heard, locked; /* locked: its lock has been seen held */
    enum presence presence;
    int64_t met_ns; /* since when its process is seen to live */
    int64_t epoch_ns, heard_ns;
    int64_t twin_ns; /* when an older process of the name was heard; 0: never */
    struct history history;
};

/* The place of the topic among the node's links; TABLE_MAX_LINKS: there is none. */
static size_t link_place(struct table_node *row, const struct topic *t, bool published)
{
    for (size_t i = 0; i < row->n_links; i++)
        if (row->links[i].topic == t && row->links[i].published == published)
            return i;
    if (row->n_links < TABLE_MAX_LINKS)
        row->links[row->n_links].topic = t;
    return row->n_links < TABLE_MAX_LINKS ? row->n_links++ : TABLE_MAX_LINKS;
}

static void take_count(struct table_node *row, const Anlos__TopicCount *c,
                       struct history_sample *sample)
{
    const struct topic *t = topics_find(c->topic);
    size_t i = t ? link_place(row, t, c->published) : TABLE_MAX_LINKS;

    if (i == TABLE_MAX_LINKS)
        return; /* of another version of anlos, whose topics are not these */
    row->links[i] = (struct table_link){.topic = t,
                                        .published = c->published,
                                        .messages = c->messages,
                                        .bytes = c->bytes,
                                        .gaps = c->gaps,
                                        .dropped = c->dropped,
                                        .queued = c->queued,
                                        .latency = {.n = c->latency_n,
                                                    .median_s = c->latency_median_s,
                                                    .p99_s = c->latency_p99_s}};
    sample->links[i].messages = c->messages;
    sample->links[i].bytes = c->bytes;
    sample->links[i].lost = c->gaps + c->dropped;
}

static void take_device(struct table_node *row, const Anlos__Health *h)
{
    row->n_device = h->n_device < TABLE_MAX_DEVICE ? h->n_device : TABLE_MAX_DEVICE;
    for (size_t i = 0; i < row->n_device; i++) {
        snprintf(row->device[i].name, sizeof row->device[i].name, "%s",
                 h->device[i]->name);
        row->device[i].value = h->device[i]->value;
    }
}

static void member_health(struct member *m, const Anlos__Health *h, int64_t epoch_ns,
                          int64_t now_ns)
{
    struct table_node *row = &m->row;
    struct history_sample sample = {.at_ns = now_ns, .cpu_s = h->cpu_s};

    if (m->heard && epoch_ns < m->epoch_ns &&
        now_ns - m->heard_ns < COLLECTOR_SILENT_NS) {
        m->twin_ns = now_ns; /* the younger one stands in the table */
        return;
    }
    if (!m->heard || m->epoch_ns != epoch_ns) { /* another process: it counts anew */
        row->restarts += m->heard;
        row->n_links = 0;
        m->history.n = 0;
    }
    m->heard = true;
    m->heard_ns = now_ns;
    m->epoch_ns = epoch_ns;
    m->state = h->state;
    snprintf(row->text, sizeof row->text, "%s", h->text);
    row->pid = h->pid;
    snprintf(row->priority, sizeof row->priority, "%s", h->priority);
    row->uptime_s = h->uptime_s;
    row->rss_bytes = h->rss_bytes;
    row->refused = h->refused;
    row->refused_connections = h->refused_connections;
    for (size_t i = 0; i < h->n_topics; i++)
        take_count(row, h->topics[i], &sample);
    take_device(row, h);
    history_add(&m->history, &sample);
}

static void member_presence(struct member *m, enum presence presence, int64_t now_ns)
{
    if (presence == PRESENCE_ALIVE && m->presence != PRESENCE_ALIVE)
        m->met_ns = now_ns;
    m->presence = presence;
    m->locked |= presence == PRESENCE_ALIVE;
}

static bool member_is_known(const struct member *m)
{
    return m->heard || m->presence != PRESENCE_NEVER;
}

static enum table_node_state judge(const struct member *m, int64_t now_ns)
{
    bool recent = m->heard && now_ns - m->heard_ns < COLLECTOR_SILENT_NS;

    if (m->locked && m->presence != PRESENCE_ALIVE)
        return TABLE_DEAD;
    if (!recent && m->presence == PRESENCE_ALIVE)
        return m->heard || now_ns - m->met_ns >= COLLECTOR_SILENT_NS ? TABLE_SILENT
                                                                     : TABLE_STARTING;
    if (!recent)
        return m->heard ? TABLE_DEAD : TABLE_OFF;
    switch (m->state) {
    case ANLOS__HEALTH__STATE__READY:
        return TABLE_READY;
    case ANLOS__HEALTH__STATE__DEGRADED:
        return TABLE_DEGRADED;
    case ANLOS__HEALTH__STATE__FAULT:
        return TABLE_FAULT;
    default:
        return TABLE_STARTING;
    }
}

/* These tell of the node or of its host, not of its work. */
static bool is_work(const struct table_link *l)
{
    return l->topic != topic_health() && l->topic != topic_log() &&
           l->topic != topic_host();
}

/* How well it tells of the node's work: the pings that it is done with, else what it puts
 * out at a rate of its own, else the pings that it takes in. */
static int rank(const struct table_link *l)
{
    bool of_pings = table_is_of_pings(l->topic);

    if (l->published)
        return of_pings ? 4 : l->expected_hz > 0 ? 3 : 1;
    return of_pings ? 2 : 0;
}

static bool tells_more(const struct table_link *a, const struct table_link *b)
{
    if (!a->messages != !b->messages)
        return a->messages;
    if (rank(a) != rank(b))
        return rank(a) > rank(b);
    return a->expected_hz > b->expected_hz;
}

/* Of what flows the link that tells most. */
static const struct table_link *main_link(const struct table_node *row)
{
    const struct table_link *best = NULL;

    for (size_t i = 0; i < row->n_links; i++)
        if (is_work(&row->links[i]) && (!best || tells_more(&row->links[i], best)))
            best = &row->links[i];
    return best;
}

/* As main_link, of the messages with a capture stamp. */
static struct table_latency main_latency(const struct table_node *row)
{
    const struct table_link *best = NULL;

    for (size_t i = 0; i < row->n_links; i++) {
        const struct table_link *l = &row->links[i];
        if (!l->latency.n)
            continue;
        if (!best || l->published > best->published ||
            (l->published == best->published && l->latency.n > best->latency.n))
            best = l;
    }
    return best ? best->latency : (struct table_latency){0};
}

static void sum_links(struct table_node *row)
{
    row->in_hz = row->out_hz = 0;
    for (size_t i = 0; i < row->n_links; i++) {
        const struct table_link *l = &row->links[i];
        row->queued += l->queued;
        row->dropped += l->dropped;
        row->gaps += l->gaps;
        if (is_work(l))
            *(l->published ? &row->out_hz : &row->in_hz) += l->rate_hz;
    }
}

/* What a process that is gone did at the end is not what it does. */
static void still(struct table_node *row)
{
    row->cpu = row->in_hz = row->out_hz = row->rate_hz = NAN;
    row->rss_bytes = 0;
    row->queued = 0;
    row->latency = (struct table_latency){0};
    for (size_t i = 0; i < row->n_links; i++) {
        row->links[i].rate_hz = row->links[i].bytes_s = NAN;
        row->links[i].queued = 0;
        row->links[i].lost_lately = 0;
        row->links[i].latency = (struct table_latency){0};
    }
}

static void member_row(const struct member *m, int64_t now_ns,
                       const struct table_scan *scan, struct table_node *out)
{
    *out = m->row;
    out->state = judge(m, now_ns);
    out->presence = m->presence;
    if (!m->heard)
        out->uptime_s = NAN;
    out->silent_s = m->heard ? 1e-9 * (double)(now_ns - m->heard_ns) : NAN;
    out->twin = m->twin_ns && now_ns - m->twin_ns < COLLECTOR_SILENT_NS;
    history_rates(&m->history, out);
    for (size_t i = 0; i < out->n_links; i++)
        out->links[i].expected_hz = expected_hz(out->links[i].topic, out->name, scan);
    sum_links(out);
    const struct table_link *link = main_link(out);
    out->rate_hz = link ? link->rate_hz : NAN;
    out->expected_hz = link ? link->expected_hz : 0;
    out->latency = main_latency(out);
    if (!table_node_is_alive(out))
        still(out);
}

/* -- topics, as the sum of what the nodes say of them
 * -------------------------------------
 */

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

static enum table_topic_state judge_topic(const struct table_topic *t,
                                          uint64_t lost_lately, double hz, bool runs)
{
    if (!t->known && !t->messages)
        return TABLE_ABSENT;
    if (t->known && !t->alive)
        return TABLE_CUT;
    if (lost_lately)
        return TABLE_LOSING;
    if (runs && t->messages && t->rate_hz < hz / 4)
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
    t->expected_hz = publishers * expected_hz(t->topic, NULL, &table->scan);
    t->state = judge_topic(t, flow.lost_lately,
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

const struct table_node *table_find(const struct table *t, const char *node)
{
    for (size_t i = 0; i < t->n_nodes; i++)
        if (!strcmp(t->nodes[i].name, node))
            return &t->nodes[i];
    return NULL;
}

/* -- all of it
 * ----------------------------------------------------------------------------
 */

struct collector {
    size_t n_members;
    struct member members[TABLE_MAX_NODES]; /* in the order of msgs/topics.h */
    struct table_scan scan;
    struct table_objects objects;
    size_t n_logs; /* ever come; the newest stands at (n_logs - 1) % TABLE_MAX_LOGS */
    struct table_log logs[TABLE_MAX_LOGS];
};

int collector_create(struct collector **out)
{
    const char *const *names = topics_nodes();
    struct collector *c = calloc(1, sizeof *c);

    if (!c)
        return -ENOMEM;
    for (; names[c->n_members] && c->n_members < TABLE_MAX_NODES; c->n_members++)
        snprintf(c->members[c->n_members].row.name, ENVELOPE_NODE_SIZE, "%s",
                 names[c->n_members]);
    *out = c;
    return 0;
}

static struct member *find_member(struct collector *c, const char *node)
{
    for (size_t i = 0; i < c->n_members; i++)
        if (!strcmp(c->members[i].row.name, node))
            return &c->members[i];
    return NULL;
}

void collector_health(struct collector *c, const Anlos__Health *m, int64_t epoch_ns,
                      int64_t now_ns)
{
    struct member *member = find_member(c, m->node);

    if (member)
        member_health(member, m, epoch_ns, now_ns);
}

void collector_presence(struct collector *c, const char *node, enum presence presence,
                        int64_t now_ns)
{
    struct member *member = find_member(c, node);

    if (member)
        member_presence(member, presence, now_ns);
}

void collector_scan(struct collector *c, const Anlos__ScanStatus *m)
{
    c->scan = (struct table_scan){.known = true,
                                  .state = m->state,
                                  .pass = m->pass,
                                  .scan = m->scan,
                                  .position = m->position,
                                  .done = m->pings_done,
                                  .expected = m->pings_expected,
                                  .retaken = m->pings_retaken,
                                  .given_up = m->pings_lost,
                                  .left_s = m->time_left_s};
    snprintf(c->scan.text, sizeof c->scan.text, "%s", m->text);
}

static void take_object(struct table_object *o, const Anlos__DetectionList *list,
                        const Anlos__Detection *d)
{
    const Anlos__Vec3 *p = d->position_m;

    *o = (struct table_object){.id = d->id,
                               .measurement = d->measurement,
                               .shape = d->shape,
                               .in_vehicle_frame = list->in_vehicle_frame,
                               .mirrored = list->mirrored,
                               .at_m = {NAN, NAN, NAN},
                               .velocity_m_s = {NAN, NAN},
                               .existence = d->existence,
                               .age_s = list->tracked ? d->age_s : NAN,
                               .unseen_s = list->tracked ? d->unseen_s : NAN};
    if (p)
        memcpy(o->at_m, (double[3]){p->x, p->y, p->z}, sizeof o->at_m);
    if (d->n_velocity_m_s == 2)
        memcpy(o->velocity_m_s, d->velocity_m_s, sizeof o->velocity_m_s);
}

void collector_objects(struct collector *c, const Anlos__DetectionList *m)
{
    c->objects.known = true;
    c->objects.n = 0;
    for (size_t i = 0; i < m->n_detections && c->objects.n < TABLE_MAX_OBJECTS; i++)
        if (m->detections[i]->measurement != ANLOS__MEASUREMENT__DELETED)
            take_object(&c->objects.list[c->objects.n++], m, m->detections[i]);
}

/* Of the n-th line that has ever come. */
static struct table_log *log_at(struct collector *c, size_t n)
{
    return &c->logs[n % TABLE_MAX_LOGS];
}

/* A line may come over the bus and stand in the file for late comers. */
static bool is_known(struct collector *c, const Anlos__Log *m)
{
    size_t first = c->n_logs > TABLE_MAX_LOGS ? c->n_logs - TABLE_MAX_LOGS : 0;

    for (size_t i = first; i < c->n_logs; i++) {
        const struct table_log *l = log_at(c, i);
        if (l->stamp_ns == m->stamp_ns && !strcmp(l->node, m->node) &&
            !strncmp(l->text, m->text, sizeof l->text - 1))
            return true;
    }
    return false;
}

/* The newest comes last, whenever it was heard of. */
static void sort_last(struct collector *c)
{
    size_t first = c->n_logs > TABLE_MAX_LOGS ? c->n_logs - TABLE_MAX_LOGS : 0;

    for (size_t i = c->n_logs - 1; i > first; i--) {
        struct table_log *before = log_at(c, i - 1), *l = log_at(c, i), other = *l;
        if (before->stamp_ns <= l->stamp_ns)
            break;
        *l = *before;
        *before = other;
    }
}

void collector_log(struct collector *c, const Anlos__Log *m)
{
    static const char *const levels[] = {"debug", "info", "warning", "error"};
    unsigned level = (unsigned)m->level;

    if (is_known(c, m))
        return;
    struct table_log *l = log_at(c, c->n_logs++);

    *l = (struct table_log){
        .stamp_ns = m->stamp_ns, .repeats = m->repeats, .left_out = m->left_out};
    snprintf(l->level, sizeof l->level, "%s", level < 4 ? levels[level] : "?");
    snprintf(l->node, sizeof l->node, "%s", m->node);
    snprintf(l->text, sizeof l->text, "%s", m->text);
    sort_last(c);
}

static void fill_logs(const struct collector *c, struct table *out)
{
    out->n_logs = c->n_logs < TABLE_MAX_LOGS ? c->n_logs : TABLE_MAX_LOGS;
    for (size_t i = 0; i < out->n_logs; i++)
        out->logs[i] = c->logs[(c->n_logs - out->n_logs + i) % TABLE_MAX_LOGS];
}

static void fill_nodes(const struct collector *c, int64_t now_ns, struct table *out)
{
    out->n_nodes = 0;
    out->lost = 0;
    for (size_t i = 0; i < c->n_members; i++) {
        if (!member_is_known(&c->members[i]))
            continue;
        struct table_node *row = &out->nodes[out->n_nodes++];
        member_row(&c->members[i], now_ns, &c->scan, row);
        out->lost += row->gaps + row->dropped;
        if (!strcmp(row->name, "scan"))
            out->scan.over = !table_node_is_alive(row);
        if (!strcmp(row->name, "track"))
            out->objects.over = !table_node_is_alive(row);
    }
}

void collector_table(const struct collector *c, int64_t now_ns, struct table *out)
{
    out->scan = c->scan;
    out->objects = c->objects;
    fill_nodes(c, now_ns, out);
    fill_logs(c, out);
    table_fill_topics(out);
}

void collector_destroy(struct collector *c)
{
    free(c);
}
