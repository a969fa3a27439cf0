/* SPDX-License-Identifier: MIT */
#include "nodes/rt/health.h"

#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "dsp/rank.h"

/* -- how old the sound is in what is taken and published --------------------------------
 */

static const struct latency_track *find(const struct latencies *l, const struct topic *t,
                                        bool published)
{
    for (size_t i = 0; i < l->n; i++)
        if (l->tracks[i].topic == t && l->tracks[i].published == published)
            return &l->tracks[i];
    return NULL;
}

static struct latency_track *find_or_begin(struct latencies *l, const struct topic *t,
                                           bool published)
{
    const struct latency_track *known = find(l, t, published);

    if (known)
        return &l->tracks[known - l->tracks];
    if (l->n == LATENCIES_MAX_TOPICS)
        return NULL;
    l->tracks[l->n].topic = t;
    l->tracks[l->n].published = published;
    return &l->tracks[l->n++];
}

void latencies_add(struct latencies *l, const struct topic *t, bool published,
                   int64_t now_ns, int64_t capture_ns)
{
    struct latency_track *track = capture_ns ? find_or_begin(l, t, published) : NULL;

    if (track)
        track->ring[track->n++ % LATENCIES_DEPTH] = (struct latency_sample){
            .at_ns = now_ns, .s = 1e-9 * (double)(now_ns - capture_ns)};
}

struct latency_summary latencies_summarise(const struct latencies *l,
                                           const struct topic *t, bool published,
                                           int64_t now_ns)
{
    const struct latency_track *track = find(l, t, published);
    size_t held = !track ? 0 : track->n < LATENCIES_DEPTH ? track->n : LATENCIES_DEPTH;
    double ranked[LATENCIES_DEPTH];
    size_t n = 0;

    for (size_t i = 0; i < held; i++)
        if (track->ring[i].at_ns <= now_ns &&
            track->ring[i].at_ns > now_ns - LATENCIES_WINDOW_NS)
            ranked[n++] = track->ring[i].s;
    if (!n)
        return (struct latency_summary){0};
    return (struct latency_summary){.n = n,
                                    .median_s = rank_double(ranked, n, (n + 1) / 2),
                                    .p99_s = rank_double(ranked, n, (99 * n + 99) / 100)};
}

/* -- does it keep up --------------------------------------------------------------------
 */

bool pace_is_late(struct pace *p, int64_t now_ns)
{
    uint64_t done = p->done - p->then_done, skipped = p->skipped - p->then_skipped;

    if (now_ns < p->due_ns)
        return p->late;
    p->due_ns = now_ns + PACE_LOOK_NS;
    p->then_done = p->done;
    p->then_skipped = p->skipped;
    p->late = (double)skipped > PACE_LATE * (double)(done + skipped);
    return p->late;
}

/* -- what is said -----------------------------------------------------------------------
 */

/* -- the message --------------------------------------------------------------------- */

static double cpu_seconds(void)
{
    struct rusage u;

    if (getrusage(RUSAGE_SELF, &u))
        return 0.0;
    return (double)u.ru_utime.tv_sec + (double)u.ru_stime.tv_sec +
           1e-6 * ((double)u.ru_utime.tv_usec + (double)u.ru_stime.tv_usec);
}

static uint64_t resident_bytes(void)
{
    unsigned long pages = 0;
    FILE *f = fopen("/proc/self/statm", "re");

    if (!f)
        return 0;
    if (fscanf(f, "%*u %lu", &pages) != 1)
        pages = 0;
    fclose(f);
    return (uint64_t)pages * (uint64_t)sysconf(_SC_PAGESIZE);
}

void health_take(struct health *out, struct bus *bus, char *node, uint64_t malformed)
{
    struct bus_count counts[HEALTH_MAX_TOPICS];
    size_t n = bus_counts(bus, counts, HEALTH_MAX_TOPICS);

    if (n > HEALTH_MAX_TOPICS)
        n = HEALTH_MAX_TOPICS;
    anlos__health__init(&out->message);
    for (size_t i = 0; i < n; i++) {
        Anlos__TopicCount *c = &out->counts[i];
        anlos__topic_count__init(c);
        c->topic = (char *)counts[i].topic->name;
        c->published = counts[i].published;
        c->messages = counts[i].messages;
        c->bytes = counts[i].bytes;
        c->gaps = counts[i].gaps;
        c->dropped = counts[i].dropped;
        c->queued = (uint32_t)counts[i].queued;
        c->peers = (uint32_t)counts[i].peers;
        out->count_list[i] = c;
    }
    out->message.node = node;
    out->message.pid = (uint32_t)getpid();
    out->message.cpu_s = cpu_seconds();
    out->message.rss_bytes = resident_bytes();
    out->message.n_topics = n;
    out->message.topics = out->count_list;
    out->message.refused = bus_refused(bus) + malformed;
    out->message.refused_connections = bus_refused_connections(bus);
}

/* Adds how old the sound is in what the node takes and publishes. */
static void put_latencies(struct health *out, const struct latencies *l, int64_t now_ns)
{
    for (size_t i = 0; i < out->message.n_topics; i++) {
        Anlos__TopicCount *c = &out->counts[i];
        struct latency_summary s =
            latencies_summarise(l, topics_find(c->topic), c->published, now_ns);
        c->latency_n = (uint32_t)s.n;
        c->latency_median_s = s.median_s;
        c->latency_p99_s = s.p99_s;
    }
}

void health_device(struct health *out, const struct device_count *counts, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        anlos__device_count__init(&out->device[i]);
        out->device[i].name = (char *)counts[i].name;
        out->device[i].value = counts[i].value;
        out->device_list[i] = &out->device[i];
    }
    out->message.n_device = n;
    out->message.device = out->device_list;
}

void health_faults(Anlos__Health *message, struct health_faults *out,
                   const struct health_fault *faults, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        anlos__fault__init(&out->faults[i]);
        out->faults[i].name = (char *)faults[i].name;
        out->faults[i].count = faults[i].count;
        out->faults[i].of = faults[i].of;
        out->list[i] = &out->faults[i];
    }
    message->n_faults = n;
    message->faults = out->list;
}

/* -- a node's, whenever it is time to ------------------------------------------------ */

#define PERIOD_NS      1000000000LL
#define LOOK_PERIOD_NS 100000000LL /* for new connections, in a young process */
#define YOUNG_NS       10000000000LL

static void look_at_priority(struct heartbeat *h)
{
    static const char none[] = "lost, for it computed without a pause";

    if (!priority_is_lost() || !strcmp(h->priority, none))
        return;
    priority_drop();
    log_write(h->log, LOG_LEVEL_WARNING,
              "computed for a second without a pause: its real-time priority (%s) is "
              "taken away, so that others go on",
              h->priority);
    snprintf(h->priority, sizeof h->priority, "%s", none);
}

/* Says how the node is, now; also tells of repeated lines in its log. */
static void heartbeat_publish(struct heartbeat *h)
{
    struct health v;
    struct device_count counts[DEVICE_MAX_COUNTS];
    struct health_faults faults;
    int64_t machine_ns = clock_now_ns(h->clock->machine);
    int64_t now_ns = clock_now_ns(&h->clock->source);

    log_tick(h->log);
    look_at_priority(h);
    health_take(&v, h->bus, h->node, h->malformed);
    put_latencies(&v, &h->latencies, now_ns);
    if (h->device)
        health_device(&v, counts, h->counts(h->device, counts));
    health_faults(&v.message, &faults, h->faults, h->n_faults);
    v.message.sensing = (Anlos__Sensing *)(uintptr_t)h->sensing;
    v.message.ended = h->ended;
    v.message.state = h->state;
    v.message.text = h->text;
    v.message.priority = h->priority;
    v.message.turns = h->turns;
    v.message.turn_limit_s = h->busy_s > 0.0 ? h->busy_s : h->turn_limit_s;
    v.message.uptime_s = (double)(machine_ns - h->epoch_ns) * 1e-9;
    h->due_ns = machine_ns + PERIOD_NS;
    int err = bus_publish_message(h->bus, topic_health(), 0, now_ns, &v.message.base);
    if (err)
        log_write(h->log, LOG_LEVEL_ERROR, "cannot publish health: %s", strerror(-err));
}

/* Whoever waits for this node wants to know when it hears those whom it listens to; and
 * who begins to listen to its health has missed what it said so far. */
static void look_at_peers(struct heartbeat *h, int64_t now_ns)
{
    struct bus_count counts[HEALTH_MAX_TOPICS];
    size_t peers = 0;

    if (now_ns < h->look_due_ns)
        return;
    h->look_due_ns = now_ns - h->epoch_ns < YOUNG_NS ? now_ns + LOOK_PERIOD_NS
                                                     : h->due_ns;
    size_t n_counts = bus_counts(h->bus, counts, HEALTH_MAX_TOPICS);
    for (size_t i = 0; i < n_counts && i < HEALTH_MAX_TOPICS; i++)
        if (!counts[i].published || counts[i].topic == topic_health())
            peers += counts[i].peers;
    if (peers != h->peers)
        h->due_ns = now_ns;
    h->peers = peers;
}

int64_t heartbeat_tick(struct heartbeat *h, int64_t now_ns)
{
    look_at_peers(h, now_ns);
    if (now_ns >= h->due_ns)
        heartbeat_publish(h);
    return h->look_due_ns < h->due_ns ? h->look_due_ns : h->due_ns;
}

void heartbeat_turn(struct heartbeat *h)
{
    h->turns++;
    h->busy_s = 0.0;
}

void heartbeat_busy(struct heartbeat *h, double limit_s)
{
    h->turns++;
    h->busy_s = limit_s;
    heartbeat_publish(h);
}

void heartbeat_state(struct heartbeat *h, Anlos__Health__State state, const char *text)
{
    if (state == h->state && !strcmp(text, h->text))
        return;
    if (state != h->state)
        log_write(h->log,
                  state == ANLOS__HEALTH__STATE__FAULT      ? LOG_LEVEL_ERROR
                  : state == ANLOS__HEALTH__STATE__DEGRADED ? LOG_LEVEL_WARNING
                                                            : LOG_LEVEL_DEBUG,
                  "%s", text);
    h->state = state;
    snprintf(h->text, sizeof h->text, "%s", text);
    heartbeat_publish(h);
}

void heartbeat_fault(struct heartbeat *h, const char *name, uint32_t count, uint32_t of)
{
    size_t i = 0;

    while (i < h->n_faults && strcmp(h->faults[i].name, name))
        i++;
    if (i == h->n_faults && (!count || i == HEALTH_MAX_FAULTS))
        return;
    const struct health_fault now = {name, count, of};
    bool changed = i == h->n_faults || h->faults[i].count != count;
    h->n_faults += i == h->n_faults;
    h->faults[i] = now;
    if (!count)
        h->faults[i] = h->faults[--h->n_faults];
    if (changed)
        heartbeat_publish(h);
}
