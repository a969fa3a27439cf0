/* SPDX-License-Identifier: MIT */
#include "nodes/play/playback.h"

#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/play/playback_state.h"

#define SETTLE_NS       300000000LL /* who listens already finds the new sockets by then */
#define REPEAT_NS       1000000000LL /* as the array repeats its survey */
#define REPEAT_WAITS_NS 200000000LL  /* the sooner all are ready */
#define TELL_NS         50000000LL   /* between that and the first message */
#define HOLD_NS         50000000LL   /* nothing tells that time has run out */

/* The bag's time is here now: after a pause, a seek, another rate, or a wait. */
static void tempo_set(struct tempo *t, int64_t bag_ns, int64_t machine_ns)
{
    t->started = true;
    t->bag_ns = bag_ns;
    t->machine_ns = machine_ns;
}

/* The machine's time at which it is due; the first time it is asked, now. */
static int64_t tempo_due_ns(struct tempo *t, int64_t bag_ns, int64_t machine_ns)
{
    if (!t->started)
        tempo_set(t, bag_ns, machine_ns);
    if (t->rate <= 0.0)
        return machine_ns;
    double after_ns = ((double)bag_ns - (double)t->bag_ns) / t->rate;

    return after_ns < 9e17 ? t->machine_ns + (int64_t)after_ns : INT64_MAX;
}

int playback_create(struct playback **out, const struct playback_config *cfg,
                    int64_t epoch_ns, struct error *why)
{
    struct playback *p = calloc(1, sizeof *p);
    int err = p ? 0 : error_say(why, -ENOMEM, "out of memory");

    if (err)
        return err;
    p->cfg = *cfg;
    p->paused = cfg->paused;
    if (p->cfg.window < 1 || p->cfg.window > ACCOUNT_MAX)
        p->cfg.window = ACCOUNT_MAX;
    p->tempo.rate = cfg->rate;
    err = bag_iterator_open(&p->bag_iterator, &cfg->bag_iterator, why);
    if (!err)
        err = playback_publisher_create(&p->playback_publisher, cfg->run_dir, epoch_ns,
                                        why);
    if (!err)
        err = playback_cast(p, why);
    if (err) {
        playback_destroy(p);
        return err;
    }
    if (bag_iterator_foreign(p->bag_iterator))
        playback_notes(p, "%s: %zu channels are of no topic here, and are not played",
                       cfg->bag_iterator.bag, bag_iterator_foreign(p->bag_iterator));
    p->at_ns = bag_iterator_start_ns(p->bag_iterator);
    p->progress_round = (uint64_t)epoch_ns; /* who hears it may have heard another play */
    p->told_ns = p->at_ns - 1;
    bag_iterator_seek(p->bag_iterator, p->at_ns);
    *out = p;
    return 0;
}

void playback_notes(struct playback *p, const char *format, ...)
{
    va_list args;

    va_start(args, format);
    vsnprintf(p->note, sizeof p->note, format, args);
    va_end(args);
    p->noted = true;
}

const char *playback_note(struct playback *p)
{
    bool noted = p->noted;

    p->noted = false;
    return noted ? p->note : NULL;
}

void playback_health(struct playback *p, const char *from, int64_t epoch_ns,
                     const Anlos__Health *h, int64_t now_ns)
{
    if (!subscribers_health(&p->subscribers, from, epoch_ns, h, now_ns))
        return;
    if (p->begun && !p->ended) {
        p->stopped++;
        playback_notes(p, "%s was started again: what it knew of the recording is lost",
                       from);
    }
    if (!p->scan || p->scan_ended || (strcmp(from, "dsp") && strcmp(from, "recon")))
        return;
    account_give_up(&p->account);
    playback_notes(p,
                   "%s was started again: what it knew of scan %u is lost; play it again",
                   from, p->scan);
}

void playback_progress(struct playback *p, const char *from, const Anlos__Progress *m)
{
    uint64_t lost = subscribers_lost(&p->subscribers);

    if (subscribers_progress(&p->subscribers, from, m) && !lost && m->lost)
        playback_notes(p, "messages got lost on the way to %s; more are only counted",
                       from);
}

/* All before the next message went out; of its own stamp those that do not wait for it.
 */
static int64_t sent_until(const struct playback *p)
{
    int64_t until_ns = p->told_ns;

    if (p->next.is)
        until_ns = p->next.m.envelope.publish_ns - !p->crowded;
    else if (p->bag_iterator_ended)
        until_ns = p->at_ns;
    return until_ns > p->told_ns ? until_ns : p->told_ns;
}

bool playback_tells(struct playback *p, Anlos__Progress *out, Anlos__Sent *sent,
                    Anlos__Sent **list, char **nodes, size_t max, int64_t now_ns)
{
    int64_t until_ns = sent_until(p);
    const struct topic *t;
    const char *node;
    uint64_t n;

    if (until_ns == p->told_ns && now_ns - p->told_at_ns < REPEAT_WAITS_NS)
        return false;
    anlos__progress__init(out);
    out->time_ns = p->told_ns = until_ns;
    p->told_at_ns = now_ns;
    out->round = p->progress_round;
    out->sent = list;
    for (size_t i = 0;
         i < max && playback_publisher_sent(p->playback_publisher, i, &node, &t, &n);
         i++) {
        anlos__sent__init(&sent[i]);
        sent[i].node = (char *)node;
        sent[i].topic = (char *)t->name;
        sent[i].next = n;
        list[out->n_sent++] = &sent[i];
    }
    out->nodes = nodes;
    for (size_t i = 0; i < p->subscribers.n && i < max; i++)
        if (p->subscribers.list[i].paces && !p->subscribers.list[i].given_up)
            nodes[out->n_nodes++] = p->subscribers.list[i].name;
    return true;
}

void playback_receipt(struct playback *p, const Anlos__Receipt *r, int64_t now_ns)
{
    uint64_t unused = p->account.unused, missing = p->account.missing;

    if (!account_receipt(&p->account, r))
        return;
    p->sign_ns = now_ns;
    if (r->usable && r->pass == ANLOS__PASS__SCENE && r->scan == p->scan) {
        p->scene_used++;
        p->used_frame = r->frame;
    }
    if (!unused && p->account.unused)
        playback_notes(
            p,
            "a ping could not be used (scan %u, position %u, speaker %u)%s; more "
            "are only counted",
            r->scan, r->position, r->speaker,
            r->pass == ANLOS__PASS__BACKGROUND ? ": dsp has not heard its background"
                                               : "");
    if (!missing && p->account.missing)
        playback_notes(p,
                       "a ping was lost on the way before position %u, speaker %u; more "
                       "are only counted",
                       r->position, r->speaker);
}

void playback_traces(struct playback *p, const Anlos__Traces *t, int64_t now_ns)
{
    Anlos__Receipt r = ANLOS__RECEIPT__INIT;

    r.scan = t->scan;
    r.position = t->position;
    r.speaker = t->speaker;
    r.frame = t->frame;
    r.usable = true;
    playback_receipt(p, &r, now_ns);
}

bool playback_wants_traces(const struct playback *p)
{
    return p->flow == topic_ping() && !subscribers_has(&p->subscribers, "recon");
}

void playback_list(struct playback *p, const Anlos__DetectionList *list)
{
    if (list->preview)
        return;
    p->lists++;
    p->list_scan = list->scan;
    p->list_frame = list->frame;
}

size_t playback_speakers(const struct playback *p, const struct topic *t)
{
    const char *node;
    size_t n = 0;

    for (size_t i = 0; (node = topic_publisher(t, i)); i++)
        n += subscribers_has(&p->subscribers, node);
    return p->cfg.several_hosts ? 0 : n;
}

void playback_hears(struct playback *p, bool all)
{
    p->hears = all;
}

static int send_next(struct playback *p, int64_t now_ns, struct error *why)
{
    struct playback_next *n = &p->next;
    const struct envelope *e = &n->m.envelope;
    bool hopeless = playback_is_hopeless(p);
    int err = 0;

    n->is = false;
    p->at_ns = e->publish_ns;
    if (hopeless)
        err = playback_say_hopeless(p, now_ns);
    else
        err = playback_publisher_publish(p->playback_publisher, n->m.part->node,
                                         n->m.part->topic, e->capture_ns, e->publish_ns,
                                         n->m.payload.data, n->m.payload.size);
    p->messages += !err;
    if (!err && p->n_under_way < UNDER_WAY_MAX) {
        p->under_way[p->n_under_way].publish_ns = p->at_ns;
        p->under_way[p->n_under_way++].flow = n->flow;
    }
    if (!err && !hopeless)
        err = playback_went(p, n, now_ns);
    return err ? error_say(why, err, "%s cannot be published: %s", n->m.part->topic->name,
                           strerror(-err))
               : 0;
}

/* Repeated, it comes before all that is played from here on. */
static void date_before(struct kept *k, int64_t at_ns)
{
    if (k->publish_ns >= at_ns)
        k->publish_ns = at_ns - 1;
}

void playback_seek(struct playback *p, int64_t publish_ns)
{
    int64_t start = bag_iterator_start_ns(p->bag_iterator),
            end = bag_iterator_end_ns(p->bag_iterator);

    p->at_ns = publish_ns < start ? start : publish_ns > end ? end : publish_ns;
    account_forget(&p->account);
    p->progress_round += p->begun;
    p->told_ns = p->at_ns - 1;
    p->told_at_ns = 0;
    p->n_under_way = 0;
    p->crowded = false;
    bag_iterator_seek(p->bag_iterator, p->at_ns);
    p->next.is = p->ended = p->bag_iterator_ended = false;
    p->tempo.started = false;
    p->scan_base = p->newest_scan;
    p->scan_epoch_ns = p->list_since_ns = 0;
    p->scan = 0;
    date_before(&p->survey, p->at_ns);
    date_before(&p->status, p->at_ns);
    p->enters = p->begun;
}

/* -EAGAIN: not all have said yet that they are in the new round.  Until then nothing goes
 * out: they tell by it what is of the round before. */
static int enter(struct playback *p, int64_t now_ns, int64_t *due_ns, struct error *why)
{
    bool told = p->told_at_ns != 0;

    p->waits_for[0] = '\0';
    if (!told)
        *due_ns = now_ns;
    if (!told || !playback_is_entered(p, now_ns))
        return -EAGAIN;
    p->enters = false;
    return playback_find_survey(p, now_ns, why);
}

/* -EAGAIN: not yet. */
static int finish(struct playback *p, int64_t now_ns, struct error *why)
{
    if (!playback_is_settled(p, now_ns) ||
        (!p->scan_ended && !playback_has_lists(p, now_ns)))
        return -EAGAIN;
    if (p->scan && !p->scan_ended) {
        int err = playback_say_end(p, now_ns);
        return err ? error_say(why, err, "scan/status: %s", strerror(-err)) : -EAGAIN;
    }
    p->rounds++;
    if (p->cfg.loop)
        playback_seek(p, bag_iterator_start_ns(p->bag_iterator));
    else
        p->ended = true;
    return 0;
}

static int introduce(struct playback *p, int64_t now_ns, struct error *why)
{
    p->begin_ns = now_ns + SETTLE_NS;
    int err = playback_find_survey(p, now_ns, why);
    if (!err && (err = playback_say_begin(p, now_ns)))
        error_say(why, err, "scan/status: %s", strerror(-err));
    return err;
}

/* 0, or -EAGAIN: still waiting. */
static int begin(struct playback *p, int64_t now_ns, struct error *why)
{
    int err = p->begin_ns ? 0 : introduce(p, now_ns, why);
    bool ready = subscribers_is_ready(&p->subscribers, p->waits_for, sizeof p->waits_for);

    if (ready && !p->hears)
        snprintf(p->waits_for, sizeof p->waits_for, "waits for connections");
    ready = ready && p->hears;
    if (!err && ready && !p->ready) { /* once more: now everybody hears it */
        err = playback_repeat(p, 0, now_ns);
        if (p->begin_ns < now_ns + TELL_NS)
            p->begin_ns = now_ns + TELL_NS;
    }
    p->ready = ready;
    p->begun = ready && now_ns >= p->begin_ns;
    if (!err && !p->begun)
        err = playback_repeat(p, REPEAT_WAITS_NS, now_ns);
    return err ? err : p->begun ? 0 : -EAGAIN;
}

/* The next message, if it may go now. */
static int advance(struct playback *p, int64_t now_ns, int64_t *due_ns, struct error *why)
{
    int64_t publish_ns = p->next.m.envelope.publish_ns;

    p->waits_for[0] = '\0';
    if (p->paused && !p->ones)
        return playback_repeat(p, REPEAT_NS, now_ns);
    int64_t at = p->ones ? now_ns : tempo_due_ns(&p->tempo, publish_ns, now_ns);
    if (at > now_ns) {
        *due_ns = at < *due_ns ? at : *due_ns;
        return playback_repeat(p, REPEAT_NS, now_ns);
    }
    if (!playback_may_go(p, now_ns)) {
        tempo_set(&p->tempo, publish_ns, now_ns); /* what it waits is not made up for */
        return playback_repeat(p, REPEAT_NS, now_ns);
    }
    p->ones -= p->ones > 0;
    *due_ns = now_ns;
    return send_next(p, now_ns, why);
}

int playback_step(struct playback *p, int64_t now_ns, int64_t *due_ns, struct error *why)
{
    int err = 0;

    *due_ns = now_ns + HOLD_NS;
    if (!p->begun)
        err = begin(p, now_ns, why);
    if (!err && p->enters)
        err = enter(p, now_ns, due_ns, why);
    if (!err && p->ended) {
        *due_ns = INT64_MAX;
        return playback_repeat(p, REPEAT_NS, now_ns);
    }
    if (!err && !p->next.is && !p->bag_iterator_ended) {
        err = playback_load(p, why);
        p->bag_iterator_ended = err == -ENODATA;
        err = p->bag_iterator_ended ? 0 : err;
    }
    if (!err && p->bag_iterator_ended)
        err = finish(p, now_ns, why);
    else if (!err)
        err = advance(p, now_ns, due_ns, why);
    return err == -EAGAIN ? 0 : err;
}

void playback_pause(struct playback *p, bool paused, int64_t now_ns)
{
    p->paused = paused;
    p->ones = 0;
    if (!paused && p->tempo.started)
        tempo_set(&p->tempo, p->at_ns, now_ns);
}

void playback_one(struct playback *p)
{
    p->ones++;
}

void playback_rate(struct playback *p, double rate, int64_t now_ns)
{
    p->tempo.rate = rate;
    if (p->tempo.started)
        tempo_set(&p->tempo, p->at_ns, now_ns);
}

void playback_status(const struct playback *p, struct playback_status *out)
{
    *out = (struct playback_status){
        .phase = p->ended    ? PLAYBACK_ENDED
                 : !p->begun ? PLAYBACK_WAITS
                 : p->paused ? PLAYBACK_PAUSES
                             : PLAYBACK_PLAYS,
        .rate = p->tempo.rate,
        .at_ns = p->at_ns,
        .start_ns = bag_iterator_start_ns(p->bag_iterator),
        .end_ns = bag_iterator_end_ns(p->bag_iterator),
        .messages = p->messages,
        .malformed = p->malformed,
        .lists = p->lists,
        .rounds = p->rounds,
        .lost = p->stopped + subscribers_lost(&p->subscribers),
        .pings = p->account,
    };
    memcpy(out->text, p->waits_for, sizeof out->text);
}

const char *playback_bag(const struct playback *p)
{
    return p->cfg.bag_iterator.bag;
}

const char *playback_stands_for(const struct playback *p, size_t i)
{
    return playback_publisher_node(p->playback_publisher, i);
}

void playback_destroy(struct playback *p)
{
    if (!p)
        return;
    playback_publisher_destroy(p->playback_publisher);
    bag_iterator_close(p->bag_iterator);
    bytes_free(&p->rewritten);
    bytes_free(&p->survey.payload);
    bytes_free(&p->status.payload);
    free(p);
}
