/* SPDX-License-Identifier: MIT */
#include "nodes/rt/latencies.h"

#include "dsp/rank.h"

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
