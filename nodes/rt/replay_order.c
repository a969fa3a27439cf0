/* SPDX-License-Identifier: MIT */
#include "nodes/rt/replay_order.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/list.h"
#include "msgs/topics.h"

bool replay_order_has(const struct topic *t)
{
    return t == topic_survey() || t == topic_stage_state() || t == topic_ping() ||
           t == topic_traces() || t == topic_echoes() || t == topic_volume() ||
           t == topic_detections() || t == topic_scan_status() || t == topic_wall() ||
           t == topic_wall_given() || t == topic_ego() || t == topic_ambient();
}

static bool is_heard(const struct replay_order *o, const struct topic *t)
{
    for (size_t i = 0; i < o->n_topics; i++)
        if (o->topics[i] == t)
            return true;
    return false;
}

void replay_order_expect(struct replay_order *o, const struct topic *t)
{
    if (replay_order_has(t) && !is_heard(o, t) && o->n_topics < REPLAY_ORDER_TOPICS)
        o->topics[o->n_topics++] = t;
}

/* -- progress ---------------------------------------------------------------------------
 */

/* In a replay the vehicle is silent, and play speaks for it: node can sends nothing. */
static bool may_send(const struct replay_order *o, const char *node)
{
    for (size_t i = 0; i < o->n_topics; i++)
        if (topic_is_published_by(o->topics[i], node) &&
            !topic_is_published_by(o->topics[i], "vehicle"))
            return true;
    return !strcmp(node, "play");
}

static struct replay_pacer *find_pacer(struct replay_order *o, const char *self,
                                       const char *node)
{
    for (size_t i = 0; i < o->n_pacers; i++)
        if (!strcmp(o->pacers[i].node, node))
            return &o->pacers[i];
    if (!strcmp(self, node) || !may_send(o, node) || o->n_pacers == REPLAY_ORDER_PACERS)
        return NULL;
    struct replay_pacer *p = &o->pacers[o->n_pacers++];
    *p = (struct replay_pacer){.heard = false};
    snprintf(p->node, sizeof p->node, "%s", node);
    return p;
}

static struct replay_heard *find_heard(struct replay_order *o, const char *node,
                                       const struct topic *t)
{
    for (size_t i = 0; i < o->n_heard; i++)
        if (o->heard[i].topic == t && !strcmp(o->heard[i].node, node))
            return &o->heard[i];
    if (o->n_heard == REPLAY_ORDER_SENT)
        return NULL;
    struct replay_heard *h = &o->heard[o->n_heard++];
    *h = (struct replay_heard){.topic = t};
    snprintf(h->node, sizeof h->node, "%s", node);
    return h;
}

/* Who began anew counts anew, and of what he sends now nothing is of a round before. */
static void follow_epoch(struct replay_heard *h, int64_t epoch_ns)
{
    if (h->epoch_ns == epoch_ns)
        return;
    h->epoch_ns = epoch_ns;
    h->first = h->next = 0;
}

static bool is_past(const struct replay_heard *h, const struct bus_message *m)
{
    return m->envelope.epoch_ns < h->epoch_ns ||
           (m->envelope.epoch_ns == h->epoch_ns && m->envelope.sequence < h->first);
}

static void drop_past(struct replay_order *o, const struct replay_heard *h)
{
    size_t kept = 0;

    for (size_t i = 0; i < o->n_waiting; i++) {
        struct bus_message *m = &o->waiting[i];
        if (m->topic == h->topic && !strcmp(m->envelope.node, h->node) && is_past(h, m))
            bus_message_free(m);
        else
            o->waiting[kept++] = *m;
    }
    o->n_waiting = kept;
}

/* first: what he says is the first of this round.  What was sent before this node
 * listened, or before play began, is not waited for; who was heard in the round before
 * has sent it then. */
static void read_sent(struct replay_order *o, struct replay_pacer *pacer, bool first,
                      const Anlos__Progress *p)
{
    bool joins = pacer->joined == o->round;

    pacer->n_sent = 0;
    for (size_t i = 0; i < p->n_sent && pacer->n_sent < REPLAY_ORDER_SENT; i++) {
        const struct topic *t = topics_find(p->sent[i]->topic);
        struct replay_sent *s = &pacer->sent[pacer->n_sent];
        if (!t || !is_heard(o, t))
            continue;
        *s = (struct replay_sent){.topic = t, .next = p->sent[i]->next};
        snprintf(s->node, sizeof s->node, "%s", p->sent[i]->node);
        pacer->n_sent++;
        struct replay_heard *h = find_heard(o, s->node, t);
        if (!h)
            continue;
        follow_epoch(h, pacer->epoch_ns);
        if (first && !joins)
            h->first = s->next;
        if ((first || (joins && p->time_ns == pacer->first_ns)) && h->next < s->next)
            h->next = s->next;
        if (first)
            drop_past(o, h);
    }
}

/* Whom play does not wait for any more, nobody does. */
static void forget_pacers(struct replay_order *o, const Anlos__Progress *p)
{
    size_t kept = 0;

    for (size_t i = 0; i < o->n_pacers; i++) {
        bool named = !strcmp(o->pacers[i].node, "play");
        for (size_t k = 0; k < p->n_nodes; k++)
            named |= !strcmp(o->pacers[i].node, p->nodes[k]);
        if (named)
            o->pacers[kept++] = o->pacers[i];
    }
    o->n_pacers = kept;
}

void replay_order_progress(struct replay_order *o, const char *self, const char *from,
                           int64_t epoch_ns, const Anlos__Progress *p)
{
    if (!p->round || p->round < o->round)
        return;
    if (p->round > o->round) {
        o->round = p->round;
        o->told_ns = INT64_MIN;
        for (size_t i = 0; i < o->n_pacers; i++)
            o->pacers[i].heard = false;
    }
    if (!strcmp(from, "play"))
        forget_pacers(o, p);
    for (size_t i = 0; i < p->n_nodes; i++)
        find_pacer(o, self, p->nodes[i]);
    struct replay_pacer *pacer = find_pacer(o, self, from);
    if (!pacer)
        return;
    o->again |= pacer->heard && pacer->time_ns == p->time_ns && !strcmp(from, "play");
    bool first = !pacer->heard;
    if (first)
        pacer->first_ns = p->time_ns;
    if (pacer->epoch_ns != epoch_ns || !pacer->joined)
        pacer->joined = o->round;
    pacer->epoch_ns = epoch_ns;
    read_sent(o, pacer, first, p);
    pacer->heard = true;
    pacer->time_ns = p->time_ns;
}

static bool is_here(struct replay_order *o, const struct replay_pacer *p)
{
    for (size_t i = 0; i < p->n_sent; i++) {
        const struct replay_heard *heard =
            find_heard(o, p->sent[i].node, p->sent[i].topic);
        if (heard && heard->next < p->sent[i].next)
            return false;
    }
    return true;
}

/* Up to here everything has come that will. */
static int64_t complete_ns(struct replay_order *o)
{
    int64_t time_ns = INT64_MAX;
    bool plays = false; /* who else has a part in it is in what play says */

    for (size_t i = 0; i < o->n_pacers; i++) {
        const struct replay_pacer *p = &o->pacers[i];
        if (!p->heard || !is_here(o, p))
            return INT64_MIN;
        plays |= !strcmp(p->node, "play");
        time_ns = p->time_ns < time_ns ? p->time_ns : time_ns;
    }
    return plays || !o->round ? time_ns : INT64_MIN;
}

/* -- messages ---------------------------------------------------------------------------
 */

static int rank(const struct topic *t)
{
    return t == topic_wall() ? 2
           : t == topic_ping() || t == topic_traces() || t == topic_echoes() ||
                   t == topic_volume() || t == topic_detections()
               ? 1
               : 0;
}

static bool is_before(const struct bus_message *a, const struct bus_message *b)
{
    if (a->envelope.publish_ns != b->envelope.publish_ns)
        return a->envelope.publish_ns < b->envelope.publish_ns;
    return rank(a->topic) < rank(b->topic);
}

int replay_order_put(struct replay_order *o, const struct bus_message *m)
{
    struct replay_heard *heard = find_heard(o, m->envelope.node, m->topic);
    size_t i = o->n_waiting;

    if (heard && is_past(heard, m)) {
        struct bus_message past = *m;
        bus_message_free(&past);
        return 0;
    }
    if (list_grow(&o->waiting, o->n_waiting, &o->n_room, sizeof *o->waiting))
        return -ENOMEM;
    if (heard) {
        follow_epoch(heard, m->envelope.epoch_ns);
        heard->next = m->envelope.sequence + 1;
    }
    while (i && o->round && is_before(m, &o->waiting[i - 1])) {
        o->waiting[i] = o->waiting[i - 1];
        i--;
    }
    o->waiting[i] = *m;
    o->n_waiting++;
    return 0;
}

bool replay_order_take(struct replay_order *o, struct bus_message *out)
{
    if (!o->n_waiting || o->waiting[0].envelope.publish_ns > complete_ns(o))
        return false;
    *out = o->waiting[0];
    o->n_waiting--;
    memmove(o->waiting, o->waiting + 1, o->n_waiting * sizeof *o->waiting);
    return true;
}

bool replay_order_done(struct replay_order *o, int64_t *time_ns)
{
    int64_t now_ns = o->round ? complete_ns(o) : INT64_MIN;
    bool again = o->again && o->round && o->told_ns != INT64_MIN;

    o->again = false;
    if (now_ns <= o->told_ns && !again)
        return false;
    if (now_ns > o->told_ns)
        o->told_ns = now_ns;
    *time_ns = o->told_ns;
    return true;
}

void replay_order_clear(struct replay_order *o)
{
    for (size_t i = 0; i < o->n_waiting; i++)
        bus_message_free(&o->waiting[i]);
    free(o->waiting);
    *o = (struct replay_order){.round = 0};
}
