/* SPDX-License-Identifier: MIT */
#include "nodes/record/balance.h"

#include <errno.h>
#include <stdlib.h>

#include "msgs/bag/manifest.h"
#include "nodes/record/pairs.h"

int balance_init(struct balance *t, const struct topic *const *topics, size_t n,
                 int64_t now_ns)
{
    *t = (struct balance){
        .list = calloc(n ? n : 1, sizeof *t->list), .n = n, .from_ns = now_ns};
    if (!t->list)
        return -ENOMEM;
    for (size_t i = 0; i < n; i++)
        t->list[i].topic = topics[i];
    return 0;
}

static struct balance_topic *find(struct balance *t, const struct topic *topic)
{
    for (size_t i = 0; i < t->n; i++)
        if (t->list[i].topic == topic)
            return &t->list[i];
    return NULL;
}

void balance_take(struct balance *t, const struct topic *topic, size_t bytes)
{
    struct balance_topic *of = find(t, topic);

    if (!of)
        return;
    of->messages++;
    of->bytes += bytes;
}

void balance_lost(struct balance *t, const struct topic *topic, uint64_t total)
{
    struct balance_topic *of = find(t, topic);

    if (of)
        of->lost = total;
}

struct balance_topic balance_sum(const struct balance *t)
{
    struct balance_topic sum = {0};

    for (size_t i = 0; i < t->n; i++) {
        sum.messages += t->list[i].messages;
        sum.bytes += t->list[i].bytes;
        sum.lost += t->list[i].lost;
    }
    return sum;
}

int balance_tell(struct balance *t, int64_t now_ns, struct bag_writer *w,
                 struct error *why)
{
    struct pairs p = {0};
    bool news = false;
    int err = 0;

    pairs_stamp(&p, MANIFEST_FROM_NS, t->from_ns);
    pairs_stamp(&p, MANIFEST_TO_NS, now_ns);
    for (size_t i = 0; i < t->n; i++) {
        struct balance_topic *of = &t->list[i];
        if (of->lost == of->told)
            continue;
        pairs_count(&p, of->topic->name, of->lost - of->told);
        of->told = of->lost;
        news = true;
    }
    if (news)
        err = pairs_write(&p, MANIFEST_LOSS, w, why);
    pairs_clear(&p);
    t->from_ns = now_ns;
    return err;
}

int balance_end_file(struct balance *t, int64_t now_ns, struct bag_writer *w,
                     struct error *why)
{
    struct pairs p = {0};
    int err = balance_tell(t, now_ns, w, why);

    for (size_t i = 0; i < t->n; i++) {
        struct balance_topic *of = &t->list[i];
        pairs_count(&p, of->topic->name, of->told - of->earlier);
        of->earlier = of->told;
    }
    if (!err)
        err = pairs_write(&p, MANIFEST_LOST, w, why);
    pairs_clear(&p);
    return err;
}

void balance_clear(struct balance *t)
{
    free(t->list);
    *t = (struct balance){0};
}
