#include "nodes/foxglove/inbox.h"

#include <errno.h>
#include <stdlib.h>

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
