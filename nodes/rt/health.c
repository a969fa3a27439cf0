/* SPDX-License-Identifier: MIT */
#include "nodes/rt/health.h"

#include <stdio.h>
#include <sys/resource.h>
#include <unistd.h>

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

void health_latencies(struct health *out, const struct latencies *l, int64_t now_ns)
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
