/* SPDX-License-Identifier: MIT */
#include "nodes/can/list_check.h"

#include <stdio.h>
#include <string.h>

static struct list_source *find_source(struct list_check *c, const char *from,
                                       int64_t epoch_ns)
{
    for (size_t i = 0; i < c->n && i < LIST_CHECK_SOURCES; i++)
        if (c->sources[i].epoch_ns == epoch_ns && !strcmp(c->sources[i].node, from))
            return &c->sources[i];
    return NULL;
}

/* Counters wrap around. */
static bool follows(const struct list_source *s, uint64_t sequence, uint32_t counter)
{
    uint32_t step = counter - s->counter;

    return sequence > s->sequence && step && step <= UINT32_MAX / 2;
}

/* What it numbers in one list alone may go beyond what the vehicle's ids do. */
static bool has_one_id_twice(const Anlos__DetectionList *list)
{
    uint8_t seen[65536 / 8] = {0};
    bool as_said = list->tracked ||
                   list->n_detections <= UINT8_MAX; /* nodes/can/sender.c */
    uint32_t most = as_said ? UINT8_MAX : UINT16_MAX;

    for (size_t i = 0; i < list->n_detections; i++) {
        uint32_t id = list->detections[i]->id & most;
        uint8_t bit = (uint8_t)(1u << id % 8);
        if (seen[id / 8] & bit)
            return true;
        seen[id / 8] |= bit;
    }
    return false;
}

static void remember(struct list_check *c, struct list_source *s, const char *from,
                     int64_t epoch_ns, uint64_t sequence, uint32_t counter)
{
    if (!s)
        s = &c->sources[c->n++ % LIST_CHECK_SOURCES];
    snprintf(s->node, sizeof s->node, "%s", from);
    s->epoch_ns = epoch_ns;
    s->sequence = sequence;
    s->counter = counter;
}

enum list_verdict list_check(struct list_check *c, const Anlos__DetectionList *list,
                             const char *from, int64_t epoch_ns, uint64_t sequence,
                             bool replayed)
{
    struct list_source *s = find_source(c, from, epoch_ns);
    enum list_verdict v = LIST_GOOD;

    if (!replayed && s && !follows(s, sequence, list->counter))
        v = LIST_REPEATED;
    else if (has_one_id_twice(list))
        v = LIST_MALFORMED;
    if (v != LIST_REPEATED)
        remember(c, s, from, epoch_ns, sequence, list->counter);
    c->verdicts[v]++;
    return v;
}

const char *list_verdict_text(enum list_verdict v)
{
    static const char *const texts[LIST_VERDICTS] = {
        [LIST_GOOD] = "it is good",
        [LIST_REPEATED] = "it, or one after it, came before",
        [LIST_MALFORMED] = "two of its objects have the same id",
    };

    return texts[v];
}
