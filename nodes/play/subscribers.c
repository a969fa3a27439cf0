/* SPDX-License-Identifier: MIT */
#include "nodes/play/subscribers.h"

#include <stdio.h>
#include <string.h>

#include "dsp/error.h"

void subscribers_init(struct subscribers *a,
                      bool (*speaks)(const void *ctx, const char *node,
                                     const struct topic *t),
                      const void *ctx)
{
    *a = (struct subscribers){.speaks = speaks, .ctx = ctx};
}

static struct listener *find(const struct subscribers *a, const char *name)
{
    for (size_t i = 0; i < a->n; i++)
        if (!strcmp(a->list[i].name, name))
            return (struct listener *)&a->list[i];
    return NULL;
}

void subscribers_expect(struct subscribers *a, const char *name)
{
    if (a->n == SUBSCRIBERS_MAX || find(a, name))
        return;
    struct listener *l = &a->list[a->n++];
    snprintf(l->name, sizeof l->name, "%s", name);
    l->paces = topic_is_published_by(topic_progress(), name);
}

bool subscribers_has(const struct subscribers *a, const char *name)
{
    return find(a, name) != NULL;
}

/* Of what everybody sends about himself nothing depends. */
static bool is_connected(const struct subscribers *a, const Anlos__Health *h)
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

bool subscribers_health(struct subscribers *a, const char *name, int64_t epoch_ns,
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

bool subscribers_is_ready(const struct subscribers *a, char *text, size_t size)
{
    text[0] = '\0';
    for (size_t i = 0; i < a->n; i++)
        if (!is_ready(&a->list[i]))
            text_add(text, size, ", ", "%s%s", text[0] ? "" : "waits for ",
                     a->list[i].name);
    return !text[0];
}

bool subscribers_progress(struct subscribers *a, const char *name,
                          const Anlos__Progress *p)
{
    struct listener *l = find(a, name);

    if (!l || !l->paces)
        return false;
    if (p->round != l->round || p->time_ns > l->used_ns)
        l->given_up = false; /* it gets on again */
    l->round = p->round;
    l->used_ns = p->time_ns;
    l->lost = p->lost;
    return true;
}

struct listener *subscribers_last(struct subscribers *a, uint64_t round, int64_t *used_ns)
{
    struct listener *last = NULL;

    *used_ns = INT64_MAX;
    for (size_t i = 0; i < a->n; i++) {
        struct listener *l = &a->list[i];
        int64_t at_ns = l->round == round ? l->used_ns : INT64_MIN;
        if (!l->paces || l->given_up || (last && at_ns >= *used_ns))
            continue;
        last = l;
        *used_ns = at_ns;
    }
    return last;
}

uint64_t subscribers_lost(const struct subscribers *a)
{
    uint64_t lost = 0;

    for (size_t i = 0; i < a->n; i++)
        lost += a->list[i].lost;
    return lost;
}

bool subscribers_heard(const struct subscribers *a, const char *name, int64_t after_ns)
{
    const struct listener *l = find(a, name);

    return !l || l->heard_ns > after_ns;
}
