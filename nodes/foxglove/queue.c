/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/queue.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

struct blob *blob_create(uint8_t *data, size_t size)
{
    struct blob *b = data ? malloc(sizeof *b) : NULL;

    if (!b) {
        free(data);
        return NULL;
    }
    atomic_init(&b->owners, 1);
    b->size = size;
    b->data = data;
    return b;
}

struct blob *blob_copy(const void *data, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);

    if (copy && size)
        memcpy(copy, data, size);
    return blob_create(copy, size);
}

struct blob *blob_hold(struct blob *b)
{
    atomic_fetch_add(&b->owners, 1);
    return b;
}

void blob_release(struct blob *b)
{
    if (!b || atomic_fetch_sub(&b->owners, 1) > 1)
        return;
    free(b->data);
    free(b);
}

struct queue_entry {
    struct outgoing outgoing;
    struct queue_entry *next;
};

/* Takes the entry at *link out. */
static struct outgoing take(struct queue *q, struct queue_entry **link)
{
    struct queue_entry *e = *link, *before = NULL;
    struct outgoing o = e->outgoing;

    if (e == q->last) {
        for (struct queue_entry *i = q->first; i != e; i = i->next)
            before = i;
        q->last = before;
    }
    *link = e->next;
    free(e);
    if (o.kind == OUTGOING_TEXT) {
        q->texts--;
    } else {
        q->messages--;
        q->bytes -= o.blob->size;
    }
    return o;
}

/* The oldest message of a channel.  NULL: none. */
static struct queue_entry **find(struct queue *q, size_t channel, bool any)
{
    for (struct queue_entry **link = &q->first; *link; link = &(*link)->next) {
        const struct outgoing *o = &(*link)->outgoing;
        if (o->kind == OUTGOING_MESSAGE && (any || o->channel == channel))
            return link;
    }
    return NULL;
}

static int make_room(struct queue *q, const struct outgoing *o)
{
    int n = 0;

    while (q->messages &&
           (q->messages >= q->max_messages || q->bytes + o->blob->size > q->max_bytes)) {
        struct queue_entry **link = find(q, o->channel, false);
        struct outgoing oldest = take(q, link ? link : find(q, 0, true));
        blob_release(oldest.blob);
        n++;
    }
    return n;
}

int queue_push(struct queue *q, const struct outgoing *o)
{
    bool text = o->kind == OUTGOING_TEXT;
    int dropped = text ? 0 : make_room(q, o);
    struct queue_entry *e = text && q->texts >= QUEUE_MAX_TEXTS ? NULL
                                                                : malloc(sizeof *e);

    if (!e) {
        blob_release(o->blob);
        return text && q->texts >= QUEUE_MAX_TEXTS ? 1 : -ENOMEM;
    }
    *e = (struct queue_entry){.outgoing = *o};
    if (q->last)
        q->last->next = e;
    else
        q->first = e;
    q->last = e;
    if (text) {
        q->texts++;
    } else {
        q->messages++;
        q->bytes += o->blob->size;
    }
    return dropped;
}

bool queue_pop(struct queue *q, struct outgoing *out)
{
    if (!q->first)
        return false;
    *out = take(q, &q->first);
    return true;
}

bool queue_drop(struct queue *q, size_t *channel)
{
    struct queue_entry **link = find(q, 0, true);

    if (!link)
        return false;
    struct outgoing o = take(q, link);
    *channel = o.channel;
    blob_release(o.blob);
    return true;
}

void queue_forget(struct queue *q, size_t channel)
{
    struct queue_entry **link;

    while ((link = find(q, channel, false)))
        blob_release(take(q, link).blob);
}

void queue_clear(struct queue *q)
{
    struct outgoing o;

    while (queue_pop(q, &o))
        blob_release(o.blob);
}

struct inbox_entry {
    struct arrival arrival;
    struct inbox_entry *next;
};

/* Late messages take nobody's place; each client and channel has one at most. */
static bool is_like(const struct arrival *a, const struct arrival *b)
{
    return a->topic == b->topic && a->client == b->client &&
           (!a->client || a->channel == b->channel);
}

static size_t depth_of(const struct arrival *a)
{
    return a->client || a->topic->policy == TOPIC_LATEST ? 1 : a->topic->depth;
}

static void drop(struct inbox_entry **link)
{
    struct inbox_entry *e = *link;

    *link = e->next;
    blob_release(e->arrival.payload);
    free(e);
}

/* What waits like a, with it, and the oldest of those. */
static struct inbox_entry **measure(struct inbox *b, const struct arrival *a, size_t *n,
                                    size_t *bytes)
{
    struct inbox_entry **oldest = NULL;

    *n = 1;
    *bytes = a->payload->size;
    for (struct inbox_entry **link = &b->first; *link; link = &(*link)->next) {
        if (!is_like(&(*link)->arrival, a))
            continue;
        oldest = oldest ? oldest : link;
        *bytes += (*link)->arrival.payload->size;
        ++*n;
    }
    return oldest;
}

int inbox_push(struct inbox *b, const struct arrival *a)
{
    struct inbox_entry *e = malloc(sizeof *e), **link, **end = &b->first;
    size_t n, bytes;
    int skipped = 0;

    if (!e) {
        blob_release(a->payload);
        return -ENOMEM;
    }
    while ((link = measure(b, a, &n, &bytes)) &&
           (n > depth_of(a) || bytes > INBOX_MAX_BYTES)) {
        drop(link);
        skipped++;
    }
    while (*end)
        end = &(*end)->next;
    *e = (struct inbox_entry){.arrival = *a};
    *end = e;
    return skipped;
}

bool inbox_pop(struct inbox *b, struct arrival *out)
{
    struct inbox_entry *e = b->first;

    if (!e)
        return false;
    b->first = e->next;
    *out = e->arrival;
    free(e);
    return true;
}

void inbox_clear(struct inbox *b)
{
    while (b->first)
        drop(&b->first);
}
