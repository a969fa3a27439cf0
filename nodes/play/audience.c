#include "nodes/play/audience.h"

#include <stdio.h>
#include <string.h>

void audience_init(struct audience *a,
                   bool (*speaks)(const void *ctx, const char *node,
                                  const struct topic *t),
                   const void *ctx)
{
    *a = (struct audience){.speaks = speaks, .ctx = ctx};
}

static struct listener *find(const struct audience *a, const char *name)
{
    for (size_t i = 0; i < a->n; i++)
        if (!strcmp(a->list[i].name, name))
            return (struct listener *)&a->list[i];
    return NULL;
}

void audience_expect(struct audience *a, const char *name)
{
    if (a->n < AUDIENCE_MAX && !find(a, name))
        snprintf(a->list[a->n++].name, ENVELOPE_NODE_SIZE, "%s", name);
}

bool audience_has(const struct audience *a, const char *name)
{
    return find(a, name) != NULL;
}

/* Of what everybody sends about himself nothing depends. */
static bool is_connected(const struct audience *a, const Anlos__Health *h)
{
    const char *node;

    for (size_t i = 0; i < h->n_topics; i++) {
        const struct topic *t = topics_find(h->topics[i]->topic);
        size_t speakers = 0;
        if (!t || h->topics[i]->published || !strcmp(t->publishers[0], "*"))
            continue;
        for (size_t k = 0; (node = topic_publisher(t, k)); k++)
            speakers += a->speaks(a->ctx, node, t);
        if (h->topics[i]->peers < speakers)
            return false;
    }
    return true;
}

bool audience_health(struct audience *a, const char *name, int64_t epoch_ns,
                     const Anlos__Health *health, int64_t now_ns)
{
    struct listener *l = find(a, name);

    if (!l || epoch_ns < l->epoch_ns)
        return false;
    bool again = l->epoch_ns && l->epoch_ns != epoch_ns;
    l->epoch_ns = epoch_ns;
    l->heard_ns = now_ns;
    l->state = health->state;
    l->connected = is_connected(a, health);
    return again;
}

static bool is_ready(const struct listener *l)
{
    return l->epoch_ns && l->connected &&
           (l->state == ANLOS__HEALTH__STATE__READY ||
            l->state == ANLOS__HEALTH__STATE__DEGRADED);
}

bool audience_is_ready(const struct audience *a, char *text, size_t size)
{
    bool all = true;
    size_t used = 0;

    if (size)
        text[0] = '\0';
    for (size_t i = 0; i < a->n; i++) {
        if (is_ready(&a->list[i]))
            continue;
        int n = used < size ? snprintf(text + used, size - used, "%s%s",
                                       all ? "waits for " : ", ", a->list[i].name)
                            : 0;
        used += (size_t)n;
        all = false;
    }
    return all;
}

bool audience_heard(const struct audience *a, const char *name, int64_t after_ns)
{
    const struct listener *l = find(a, name);

    return !l || l->heard_ns > after_ns;
}
