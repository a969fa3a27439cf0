/* SPDX-License-Identifier: MIT */
#include "nodes/record/snapshot.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "msgs/bag/manifest.h"
#include "nodes/record/recorder.h"
#include "nodes/record/ring.h"
#include "nodes/record/session.h"
#include "nodes/rt/export.h"

#define STATE_NAME "fault"

static bool states(const Anlos__Health *h, const char *name)
{
    for (size_t i = 0; i < h->n_faults; i++)
        if (h->faults[i]->count &&
            !strncmp(h->faults[i]->name, name, NEW_FAULTS_NAME - 1))
            return true;
    return h->state == ANLOS__HEALTH__STATE__FAULT && !strcmp(name, STATE_NAME);
}

static void forget(struct new_faults *f, const char *node, const Anlos__Health *h)
{
    for (size_t i = 0; i < f->n; i++)
        if (!strcmp(f->list[i].node, node) && f->list[i].lasts)
            f->list[i].lasts = states(h, f->list[i].name);
}

/* true: it is new. */
static bool take(struct new_faults *f, const char *node, const char *name, int64_t now_ns)
{
    size_t i = 0;

    while (i < f->n && (strcmp(f->list[i].node, node) ||
                        strncmp(f->list[i].name, name, NEW_FAULTS_NAME - 1)))
        i++;
    if (i == NEW_FAULTS_MAX)
        return false;
    bool first = i == f->n;
    if (first) {
        snprintf(f->list[i].node, ENVELOPE_NODE_SIZE, "%s", node);
        snprintf(f->list[i].name, NEW_FAULTS_NAME, "%s", name);
        f->n++;
    } else if (f->list[i].lasts) {
        return false;
    }
    f->list[i].lasts = true;
    if (!first && now_ns - f->list[i].told_ns < f->again_ns) {
        f->again++;
        return false;
    }
    f->list[i].told_ns = now_ns;
    return true;
}

const char *new_faults_next(struct new_faults *f, const char *node,
                            const Anlos__Health *h, int64_t now_ns)
{
    forget(f, node, h);
    for (size_t i = 0; i < h->n_faults; i++)
        if (h->faults[i]->count && take(f, node, h->faults[i]->name, now_ns))
            return h->faults[i]->name;
    if (h->state == ANLOS__HEALTH__STATE__FAULT && !h->n_faults &&
        take(f, node, STATE_NAME, now_ns))
        return STATE_NAME;
    return NULL;
}

#define STEP_MESSAGES 8 /* written in a step at most, */
#define STEP_BYTES    (1u << 20)
#define FLUSH_NS      1000000000LL
#define REASON_SIZE   81
#define NAME_SIZE     41 /* of a reason in a file's name */
#define LAST_IDS      8

struct wish {
    char from[ENVELOPE_NODE_SIZE], reason[REASON_SIZE];
    int64_t at_ns;
};

struct snapshot {
    struct snapshot_config cfg;
    struct ring *ring;
    uint64_t *totals; /* [n_topics], lost so far */
    struct new_faults faults;
    uint64_t last_ids[LAST_IDS], request_id;
    size_t next_id;
    bool told_size, told_short, told_background;

    struct recorder *recorder; /* of the bag under way; NULL: none */
    size_t n_kept;             /* of what the ring keeps for a beginning: written */
    uint64_t next;             /* entry to be written */
    int64_t until_ns, limit_ns;
    int64_t flush_due_ns;
    uint64_t *lost; /* [n_topics], in the time of this bag */
    uint64_t bag_missing;
    struct wish pending; /* at_ns 0: none */

    char path[PATH_MAX];
    struct error error;
    uint64_t saved, joined, failed, refused, missing, news;
};

static void say(const struct snapshot *s, enum log_level level, const char *text)
{
    if (s->cfg.say)
        s->cfg.say(s->cfg.context, level, text);
}

static double seconds(int64_t ns)
{
    return (double)ns / 1e9;
}

static double megabytes(size_t bytes)
{
    return 1e-6 * (double)bytes;
}

/* The place of the topic among those of bags; n_topics: it is none of them. */
static size_t place_of(const struct snapshot *s, const struct topic *t)
{
    size_t i = 0;

    while (i < s->cfg.n_topics && s->cfg.topics[i] != t)
        i++;
    return i;
}

static void count_missing(struct snapshot *s, const struct ring_entry *e)
{
    size_t i = place_of(s, e->message.topic);
    uint64_t n = e->message.payload ? 1 : e->lost;

    if (i < s->cfg.n_topics)
        s->lost[i] += n;
    s->bag_missing += n;
}

static void take_overrun(void *context, const struct ring_entry *e)
{
    struct snapshot *s = context;

    if (!s->recorder)
        return;
    count_missing(s, e);
    ring_hold(s->ring, ++s->next);
}

static int open_ring(struct snapshot *s, struct error *why)
{
    const struct ring_config ring = {.span_ns = s->cfg.before_ns,
                                     .max_bytes = s->cfg.max_bytes,
                                     .overrun = take_overrun,
                                     .context = s};
    int err = export_folder(s->cfg.folder, why);

    if (err)
        return err;
    s->totals = calloc(s->cfg.n_topics + 1, sizeof *s->totals);
    s->lost = calloc(s->cfg.n_topics + 1, sizeof *s->lost);
    if (!s->totals || !s->lost || ring_create(&s->ring, &ring))
        return error_say(why, -ENOMEM, "out of memory");
    return 0;
}

int snapshot_create(struct snapshot **out, const struct snapshot_config *cfg,
                    struct error *why)
{
    struct snapshot *s = calloc(1, sizeof *s);

    if (!s)
        return error_say(why, -ENOMEM, "out of memory");
    s->cfg = *cfg;
    s->faults.again_ns = SNAPSHOT_AGAIN_NS;
    int err = cfg->folder ? open_ring(s, why) : 0;
    if (err)
        snapshot_destroy(s);
    else
        *out = s;
    return err;
}

bool snapshot_wants(const struct snapshot *s, const struct topic *t)
{
    return t == topic_save() ||
           (s->cfg.folder && s->cfg.on_faults && t == topic_health());
}

/* -- a bag ------------------------------------------------------------------------------
 */

static void refuse(struct snapshot *s, const char *text)
{
    s->refused++;
    s->news++;
    error_say(&s->error, -EINVAL, "%s", text);
    say(s, LOG_LEVEL_WARNING, text);
}

static void name_bag(const struct snapshot *s, const struct wish *w, char path[PATH_MAX])
{
    char date[24], name[NAME_SIZE];
    time_t at = (time_t)(w->at_ns / 1000000000);
    struct tm utc;
    size_t n = 0;

    strftime(date, sizeof date, "%Y%m%dT%H%M%SZ", gmtime_r(&at, &utc));
    for (const char *c = w->reason; *c && n < sizeof name - 1; c++) {
        bool plain = isascii((unsigned char)*c) && isalnum((unsigned char)*c);
        if (plain || (n && name[n - 1] != '-'))
            name[n++] = plain ? (char)tolower((unsigned char)*c) : '-';
    }
    while (n && name[n - 1] == '-')
        n--;
    name[n] = '\0';
    snprintf(path, PATH_MAX, "%.*s/%s%s%s.mcap", PATH_MAX - 80, s->cfg.folder, date,
             n ? "_" : "", name);
}

static int64_t kept_ns(const struct snapshot *s, int64_t now_ns)
{
    struct ring_totals t;

    ring_sum(s->ring, &t);
    return t.n && now_ns > t.oldest_ns ? now_ns - t.oldest_ns : 0;
}

static int describe(struct snapshot *s, const struct wish *w, struct error *why)
{
    struct pairs p = {0};

    pairs_text(&p, MANIFEST_REASON, w->reason);
    pairs_text(&p, MANIFEST_FROM, w->from);
    pairs_stamp(&p, MANIFEST_AT_NS, w->at_ns);
    pairs_number(&p, MANIFEST_BEFORE, seconds(s->cfg.before_ns));
    pairs_number(&p, MANIFEST_KEPT, seconds(kept_ns(s, w->at_ns)));
    pairs_number(&p, MANIFEST_AFTER, seconds(s->cfg.after_ns));
    int err = recorder_pairs(s->recorder, MANIFEST_SNAPSHOT, &p, why);
    pairs_clear(&p);
    return err;
}

/* The ring goes on; what the bag has is whole. */
static void end_bag(struct snapshot *s, int64_t now_ns, int err)
{
    struct recorder_totals t;
    char text[PATH_MAX + sizeof s->error.text + 100];

    for (size_t i = 0; i < s->cfg.n_topics; i++)
        recorder_lost(s->recorder, s->cfg.topics[i], s->lost[i]);
    int ended = recorder_end(s->recorder, now_ns, err ? NULL : &s->error);
    recorder_sum(s->recorder, &t);
    recorder_destroy(s->recorder);
    s->recorder = NULL;
    s->missing += s->bag_missing + t.unwritten;
    if (err || ended) {
        s->failed++;
        snprintf(text, sizeof text,
                 "%s is not whole: %s; it has the first %" PRIu64
                 " messages, and what comes is kept on",
                 s->path, s->error.text, t.messages - t.unwritten);
        error_say(&s->error, err ? err : ended, "%.900s", text);
    } else {
        s->saved++;
        snprintf(text, sizeof text,
                 "saved %s: %" PRIu64 " messages, %.1f MB, %" PRIu64 " missing", s->path,
                 t.messages, megabytes(t.file_bytes), s->bag_missing);
    }
    say(s, s->bag_missing || err || ended ? LOG_LEVEL_WARNING : LOG_LEVEL_INFO, text);
    s->news++;
    ring_hold(s->ring, UINT64_MAX);
    ring_trim(s->ring, now_ns);
}

/* *s->error says why not. */
static int begin_bag(struct snapshot *s, const struct wish *w)
{
    char path[PATH_MAX];
    const struct recorder_config cfg = {.path = path,
                                        .free_name = true,
                                        .topics = s->cfg.topics,
                                        .n_topics = s->cfg.n_topics,
                                        .flush_ns = FLUSH_NS,
                                        .compression = s->cfg.compression,
                                        .shuffle = s->cfg.shuffle,
                                        .session = s->cfg.session,
                                        .say = s->cfg.say,
                                        .context = s->cfg.context};

    name_bag(s, w, path);
    ring_trim(s->ring, w->at_ns);
    int err = recorder_create(&s->recorder, &cfg, w->at_ns, &s->error);
    if (err) {
        s->recorder = NULL;
        return err;
    }
    snprintf(s->path, sizeof s->path, "%s", recorder_path(s->recorder));
    s->n_kept = 0;
    s->next = ring_begin(s->ring);
    s->until_ns = w->at_ns + s->cfg.after_ns;
    s->limit_ns = w->at_ns + SNAPSHOT_LONGEST * (s->cfg.before_ns + s->cfg.after_ns);
    s->flush_due_ns = INT64_MAX;
    s->bag_missing = 0;
    memset(s->lost, 0, s->cfg.n_topics * sizeof *s->lost);
    ring_hold(s->ring, s->next);
    return describe(s, w, &s->error);
}

static bool start_bag(struct snapshot *s, const struct wish *w)
{
    char text[PATH_MAX + 200];
    int err = begin_bag(s, w);

    s->news++;
    if (err && s->recorder) {
        end_bag(s, w->at_ns, err);
        return false;
    }
    if (err) {
        s->failed++;
        snprintf(text, sizeof text, "not saved (%s): %s", w->reason, s->error.text);
        say(s, LOG_LEVEL_ERROR, text);
        return false;
    }
    snprintf(text, sizeof text, "saves %s: %s of %s, the last %.1f s and %.3g s more",
             s->path, w->reason, w->from, seconds(kept_ns(s, w->at_ns)),
             seconds(s->cfg.after_ns));
    say(s, LOG_LEVEL_INFO, text);
    return true;
}

/* One more request while a bag is being written. */
static bool join(struct snapshot *s, const struct wish *w)
{
    s->joined++;
    s->news++;
    if (w->at_ns + s->cfg.after_ns > s->limit_ns) {
        if (!s->pending.at_ns)
            s->pending = *w;
        return true;
    }
    s->until_ns = w->at_ns + s->cfg.after_ns;
    int err = describe(s, w, &s->error);
    if (err)
        end_bag(s, w->at_ns, err);
    return !err;
}

bool snapshot_request(struct snapshot *s, const char *from, const char *reason,
                      int64_t now_ns)
{
    struct wish w = {.at_ns = now_ns};
    size_t n = 0;

    snprintf(w.from, sizeof w.from, "%s", from);
    for (; reason[n] && n < sizeof w.reason - 1; n++)
        w.reason[n] = isprint((unsigned char)reason[n]) ? reason[n] : '?';
    if (!n)
        snprintf(w.reason, sizeof w.reason, "request");
    s->error.text[0] = '\0';
    if (s->cfg.folder)
        return s->recorder ? join(s, &w) : start_bag(s, &w);
    refuse(s, "a request to save the last seconds, and this recorder keeps none of them: "
              "start it with --snapshot FOLDER, or with record.snapshot.folder in the "
              "launch file");
    return false;
}

int64_t snapshot_due_ns(const struct snapshot *s)
{
    if (!s->recorder)
        return s->pending.at_ns ? 0 : INT64_MAX;
    if (ring_kept(s->ring, s->n_kept) || s->next < ring_end(s->ring))
        return 0;
    return s->flush_due_ns < s->until_ns ? s->flush_due_ns : s->until_ns + 1;
}

static int write_entry(struct snapshot *s, const struct ring_entry *e, int64_t now_ns)
{
    if (e->message.payload)
        return recorder_put(s->recorder, &e->message, now_ns, &s->error);
    count_missing(s, e);
    return 0;
}

enum write {
    WRITE_ONE,
    WRITE_NONE,
    WRITE_LAST
}; /* of it; nothing is there; it has all */

/* What is next of the bag, in *e: that went to it then. */
static enum write next_of_bag(struct snapshot *s, int64_t now_ns,
                              const struct ring_entry **e)
{
    *e = ring_kept(s->ring, s->n_kept);
    if (*e) {
        s->n_kept++;
        return WRITE_ONE;
    }
    *e = ring_at(s->ring, s->next);
    if ((*e ? (*e)->came_ns : now_ns) > s->until_ns)
        return WRITE_LAST;
    s->next += *e != NULL;
    return *e ? WRITE_ONE : WRITE_NONE;
}

static void write_some(struct snapshot *s, int64_t now_ns, size_t messages, size_t most)
{
    enum write what = WRITE_ONE;
    size_t bytes = 0;
    int err = 0;

    for (size_t i = 0; !err && i < messages && bytes < most; i++) {
        const struct ring_entry *e;
        what = next_of_bag(s, now_ns, &e);
        if (what != WRITE_ONE)
            break;
        bytes += ring_cost(e);
        err = write_entry(s, e, now_ns);
        ring_hold(s->ring, s->next);
    }
    if (!err && what != WRITE_LAST)
        err = recorder_tick(s->recorder, now_ns, &s->flush_due_ns, &s->error);
    if (err || what == WRITE_LAST)
        end_bag(s, now_ns, err);
}

void snapshot_step(struct snapshot *s, int64_t now_ns)
{
    struct wish w = s->pending;

    if (s->recorder) {
        write_some(s, now_ns, STEP_MESSAGES, STEP_BYTES);
    } else if (w.at_ns) {
        s->pending.at_ns = 0;
        start_bag(s, &w);
    }
}

void snapshot_end(struct snapshot *s, int64_t now_ns)
{
    if (!s->recorder)
        return;
    s->until_ns = now_ns;
    write_some(s, now_ns, SIZE_MAX, SIZE_MAX);
    if (s->recorder)
        end_bag(s, now_ns, 0);
}

/* -- what comes -------------------------------------------------------------------------
 */

static bool is_repeated(struct snapshot *s, uint64_t id)
{
    for (size_t i = 0; id && i < LAST_IDS; i++)
        if (s->last_ids[i] == id)
            return true;
    s->last_ids[s->next_id++ % LAST_IDS] = id;
    s->request_id = id;
    return false;
}

static void take_request(struct snapshot *s, const struct bus_message *m, int64_t now_ns)
{
    Anlos__SaveRequest *r = (Anlos__SaveRequest *)bus_message_unpack(m);

    if (!r) {
        refuse(s, errno == ENOMEM
                      ? "a request to save the last seconds is not taken: out "
                        "of memory"
                      : "a request to save the last seconds cannot be read");
        return;
    }
    if (!is_repeated(s, r->id))
        snapshot_request(s, m->envelope.node, r->reason, now_ns);
    anlos__save_request__free_unpacked(r, NULL);
}

/* What cannot be read now is said again in a second. */
static void take_health(struct snapshot *s, const struct bus_message *m, int64_t now_ns)
{
    Anlos__Health *h = (Anlos__Health *)bus_message_unpack(m);
    const char *name;

    while (h && (name = new_faults_next(&s->faults, m->envelope.node, h, now_ns)))
        snapshot_request(s, m->envelope.node, name, now_ns);
    if (h)
        anlos__health__free_unpacked(h, NULL);
}

/* What the user has to know of the ring's size, once. */
static void tell_size(struct snapshot *s, int64_t now_ns)
{
    struct ring_totals t;
    char text[300];
    double span_s = seconds(kept_ns(s, now_ns));

    ring_sum(s->ring, &t);
    if (t.background_gone && !s->told_background) {
        s->told_background = true;
        snprintf(text, sizeof text,
                 "the sound of the room without the objects is not kept: it takes more "
                 "than half of the snapshot's %.0f MB, or memory ran out; what is saved "
                 "has none to subtract",
                 megabytes(s->cfg.max_bytes));
        say(s, LOG_LEVEL_WARNING, text);
    }
    if (t.shortened && !s->told_short && span_s > 0) {
        double rate = megabytes(t.bytes - t.background_bytes) / span_s;
        s->told_short = s->told_size = true;
        snprintf(
            text, sizeof text,
            "of the last %g s the snapshot's %.0f MB hold %.1f s, at %.1f MB/s: give "
            "it %.0f MB (max_mb), or leave topics out",
            seconds(s->cfg.before_ns), megabytes(s->cfg.max_bytes), span_s, rate,
            1.2 * rate * seconds(s->cfg.before_ns) + megabytes(t.background_bytes));
        say(s, LOG_LEVEL_WARNING, text);
    } else if (!s->told_size && ring_begin(s->ring)) {
        s->told_size = true;
        snprintf(text, sizeof text, "keeps the last %g s: %.0f of %.0f MB, %.1f MB/s",
                 seconds(s->cfg.before_ns), megabytes(t.bytes),
                 megabytes(s->cfg.max_bytes),
                 megabytes(t.bytes) / seconds(s->cfg.before_ns));
        say(s, LOG_LEVEL_INFO, text);
    }
}

static void count_unkept(struct snapshot *s, uint64_t n)
{
    s->missing += n;
    s->bag_missing += s->recorder ? n : 0;
}

void snapshot_put(struct snapshot *s, struct bus_message *m, int64_t now_ns)
{
    if (m->topic == topic_save())
        take_request(s, m, now_ns);
    else if (m->topic == topic_health() && s->cfg.folder && s->cfg.on_faults)
        take_health(s, m, now_ns);
    if (!s->ring || place_of(s, m->topic) == s->cfg.n_topics) {
        bus_message_free(m);
        return;
    }
    if (ring_put(s->ring, m, now_ns))
        count_unkept(s, 1);
    tell_size(s, now_ns);
}

void snapshot_lost(struct snapshot *s, const struct topic *t, uint64_t total,
                   int64_t now_ns)
{
    size_t i = place_of(s, t);

    if (!s->ring || i == s->cfg.n_topics || total <= s->totals[i])
        return;
    if (ring_lost(s->ring, t, total - s->totals[i], now_ns))
        count_unkept(s, total - s->totals[i]);
    s->totals[i] = total;
}

uint64_t snapshot_news(const struct snapshot *s)
{
    return s->news;
}

void snapshot_status(const struct snapshot *s, int64_t now_ns, Anlos__SaveStatus *out)
{
    struct ring_totals t = {0};

    anlos__save_status__init(out);
    if (s->ring)
        ring_sum(s->ring, &t);
    out->state = !s->ring ? ANLOS__SAVE_STATUS__STATE__KEEPS_NOTHING
                 : s->recorder || s->pending.at_ns ? ANLOS__SAVE_STATUS__STATE__SAVES
                                                   : ANLOS__SAVE_STATUS__STATE__KEEPS;
    out->request_id = s->request_id;
    out->path = (char *)s->path;
    out->error = (char *)s->error.text;
    out->before_s = seconds(s->cfg.before_ns);
    out->after_s = seconds(s->cfg.after_ns);
    out->kept_s = s->ring ? seconds(kept_ns(s, now_ns)) : 0;
    out->kept_bytes = t.bytes;
    out->max_bytes = s->cfg.max_bytes;
    out->saved = s->saved;
    out->joined = s->joined;
    out->failed = s->failed;
    out->refused = s->refused;
    out->missing = s->missing;
}

uint64_t snapshot_faults_again(const struct snapshot *s)
{
    return s->faults.again;
}

void snapshot_destroy(struct snapshot *s)
{
    if (!s)
        return;
    if (s->recorder)
        snapshot_end(s, s->until_ns);
    ring_destroy(s->ring);
    free(s->totals);
    free(s->lost);
    free(s);
}
