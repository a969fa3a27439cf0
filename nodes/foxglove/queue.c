#include "nodes/foxglove/queue.h"

#include <errno.h>
#include <stdlib.h>

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
