#include "nodes/anlos/top/history.h"

#include <math.h>

void history_add(struct history *h, const struct history_sample *s)
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

void history_rates(const struct history *h, struct table_node *node)
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
