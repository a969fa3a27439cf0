#include "nodes/anlos/top/member.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "nodes/anlos/collector.h"

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

void member_health(struct member *m, const Anlos__Health *h, int64_t epoch_ns,
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

void member_presence(struct member *m, enum presence presence, int64_t now_ns)
{
    if (presence == PRESENCE_ALIVE && m->presence != PRESENCE_ALIVE)
        m->met_ns = now_ns;
    m->presence = presence;
    m->locked |= presence == PRESENCE_ALIVE;
}

bool member_is_known(const struct member *m)
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

void member_row(const struct member *m, int64_t now_ns, const struct table_scan *scan,
                struct table_node *out)
{
    *out = m->row;
    out->state = judge(m, now_ns);
    if (!m->heard)
        out->uptime_s = NAN;
    out->silent_s = m->heard ? 1e-9 * (double)(now_ns - m->heard_ns) : NAN;
    out->twin = m->twin_ns && now_ns - m->twin_ns < COLLECTOR_SILENT_NS;
    history_rates(&m->history, out);
    for (size_t i = 0; i < out->n_links; i++)
        out->links[i].expected_hz =
            table_expected_hz(out->links[i].topic, out->name, scan);
    sum_links(out);
    const struct table_link *link = main_link(out);
    out->rate_hz = link ? link->rate_hz : NAN;
    out->expected_hz = link ? link->expected_hz : 0;
    out->latency = main_latency(out);
    if (!table_node_is_alive(out))
        still(out);
}
