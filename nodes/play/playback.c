/* SPDX-License-Identifier: MIT */
#include "nodes/play/playback.h"

#include <errno.h>
#include <fnmatch.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "msgs/array.pb-c.h"
#include "msgs/playback_publisher.h"
#include "msgs/survey.pb-c.h"
#include "msgs/unpack.h"
#include "nodes/play/bag_iterator.h"
#include "nodes/play/subscribers.h"
#include "nodes/rt/patterns.h"
#include "nodes/rt/rundir.h"

#define UNDER_WAY_MAX 96
#define FRAMES_AHEAD  8 /* pings of an array that stands, each of which makes an image */

struct playback_next { /* the message that is to go next */
    bool is;
    struct bag_iterator_message m; /* payload as it goes out */
    bool flow;                     /* it is one that a receipt answers: */
    struct account_ping ping;
    uint64_t survey_id;             /* of a survey */
    Anlos__ScanStatus__State state; /* of a scan/status */
    uint32_t scan;
};

struct kept { /* for who comes late */
    struct bytes_buffer payload;
    int64_t publish_ns;
    int64_t sent_ns; /* last, by the machine's clock */
    char node[ENVELOPE_NODE_SIZE];
};

/* When a message of the bag is due by the machine's clock. */
struct tempo {
    double rate; /* of the recording's pace; 0: everything is due at once */
    bool started;
    int64_t bag_ns, machine_ns; /* a point of the line that both times are on */
};

struct playback {
    struct playback_config cfg;
    struct bag_iterator *bag_iterator;
    struct playback_publisher *playback_publisher;
    struct subscribers subscribers;
    struct account account;
    struct tempo tempo;
    const struct topic *flow; /* what is answered by receipts; NULL: nothing is */
    struct playback_next next;
    struct bytes_buffer rewritten;

    bool begun, hears, paused, ended, bag_iterator_ended;
    bool enters; /* another round, in which nothing goes out before all are in it */
    unsigned ones;
    int64_t begin_ns; /* not before; 0: it is not known yet */
    bool ready;       /* all are, and were told that it begins */
    int64_t at_ns;
    int64_t sign_ns; /* last receipt, or ping after all were answered */
    char waits_for[200];
    char note[300];
    bool noted;
    uint64_t messages, malformed, lists, rounds;
    bool heard;

    /* What went out and is not used by all yet, the oldest first: [n_under_way]. */
    struct {
        int64_t publish_ns;
        bool flow;
    } under_way[UNDER_WAY_MAX];
    size_t n_under_way;
    bool crowded;            /* the next one has the stamp of all of them, and no room */
    uint64_t progress_round; /* begins with the epoch, counted on by each jump */
    int64_t told_ns;         /* in it: all up to here went out, as was said, */
    int64_t told_at_ns;      /* at this time of the machine's */
    int64_t used_ns, used_since_ns; /* how far all are; since when, by the machine */
    uint64_t stopped;               /* nodes that began anew or came no further */

    struct kept survey, status;
    uint64_t survey_id;
    size_t pings_of_scan;  /* by the survey */
    int64_t survey_new_ns; /* not 0: another one was sent then, and has to be taken */

    /* A scan that is played again, or was begun again, counts on. */
    uint32_t scan_base, newest_scan;
    int64_t scan_epoch_ns;
    uint32_t scan; /* of the newest ping */
    Anlos__Pass pass;
    uint32_t position;
    size_t scene_used;
    bool background;                 /* there was a pass of it */
    bool endless;                    /* the array stood: only a person ended it */
    uint32_t used_frame, list_frame; /* then: of the newest ping used, and list */
    uint64_t lists_then;             /* when one came last, */
    int64_t quiet_since_ns;          /* which was then; 0: not waited for */
    bool scan_ended;
    uint32_t list_scan;    /* of the newest list */
    int64_t list_since_ns; /* not 0: the list of this scan is waited for since then */

    bool says_status, has_status; /* stands in for it; the bag has it */
    int64_t status_due_ns;
};

__attribute__((format(printf, 2, 3))) static void note(struct playback *p,
                                                       const char *format, ...)
{
    va_list args;

    va_start(args, format);
    vsnprintf(p->note, sizeof p->note, format, args);
    va_end(args);
    p->noted = true;
}

/* -- who plays what to whom ---------------------------------------------------------- */

/* What the nodes of a launch file do not say themselves: not what one was told to do, how
 * a node was then, or who had used what. */
static const char launch_exclude[] =
    "stage/command,stage/manual,array/fire,receipt,health,log,clock";

/* Nothing depends on them; what they said of themselves was of then. */
static bool only_listens(const char *node)
{
    static const char *const names[] = {"play", "record", "view", "launcher"};

    for (size_t i = 0; i < sizeof names / sizeof *names; i++)
        if (!strcmp(node, names[i]))
            return true;
    return false;
}

static bool is_in_launch(const struct playback_config *cfg, const char *node)
{
    for (size_t i = 0; i < cfg->n_nodes; i++)
        if (!strcmp(cfg->nodes[i], node))
            return true;
    return false;
}

static bool is_asked_for(const struct playback_config *cfg, const char *topic)
{
    if ((cfg->exclude && patterns_match(cfg->exclude, topic)) ||
        !strcmp(topic, topic_progress()->name) || !strcmp(topic, topic_save()->name))
        return false;
    if (cfg->topics)
        return patterns_match(cfg->topics, topic);
    return cfg->alone || !patterns_match(launch_exclude, topic);
}

/* A pattern that nothing matches is a mistake. */
static int check_patterns(struct playback *p, const char *patterns, struct error *why)
{
    char pattern[PATTERN_SIZE];
    struct bag_iterator_part *part;

    while (patterns && (patterns = patterns_next(patterns, pattern))) {
        bool found = false;
        for (size_t i = 0; (part = bag_iterator_part(p->bag_iterator, i)); i++)
            found |= !fnmatch(pattern, part->topic->name, 0);
        if (!found)
            return error_say(why, -EINVAL,
                             "%s: no topic is called \"%s\"; 'anlos bag info' has their "
                             "names",
                             p->cfg.bag_iterator.bag, pattern);
    }
    return 0;
}

/* What the vehicle said comes from the node can, which is told nothing in a replay, and
 * may run. */
static void play_vehicle(const struct playback *p, struct bag_iterator_part *part)
{
    const char *vehicle = "vehicle";

    if (is_in_launch(&p->cfg, part->node) && topic_is_published_by(part->topic, vehicle))
        snprintf(part->node, sizeof part->node, "%s", vehicle);
}

/* 0: it is played, 1: not, as somebody else does it. */
static int take_part(struct playback *p, const char *node, const struct topic *t,
                     struct error *why)
{
    struct error inner = {""};

    if (is_in_launch(&p->cfg, node) || only_listens(node))
        return 1;
    int err = playback_publisher_add(p->playback_publisher, node, t, &inner);
    if (err == -EADDRINUSE && p->cfg.alone)
        return 1;
    return err ? error_say(why, err, "%s", inner.text) : 0;
}

static int take_parts(struct playback *p, struct error *why)
{
    struct bag_iterator_part *part;
    size_t n = 0;

    for (size_t i = 0; (part = bag_iterator_part(p->bag_iterator, i)); i++) {
        part->wanted = is_asked_for(&p->cfg, part->topic->name);
        play_vehicle(p, part);
        int taken = part->wanted ? take_part(p, part->node, part->topic, why) : 1;
        if (taken < 0)
            return taken;
        part->wanted = !taken;
        n += part->wanted;
        p->has_status |= part->wanted && part->topic == topic_scan_status();
    }
    if (!n)
        return error_say(why, -EINVAL,
                         "%s: nothing is left to play: the nodes that run say all that "
                         "is asked for themselves",
                         p->cfg.bag_iterator.bag);
    /* Sound that was imported has no scan beside it. */
    if (is_asked_for(&p->cfg, topic_scan_status()->name))
        p->says_status = !take_part(p, "scan", topic_scan_status(), NULL);
    int err = playback_publisher_await_recorders(p->playback_publisher);
    return err ? error_say(why, err, "out of memory") : 0;
}

static bool plays(const struct playback *p, const struct topic *t)
{
    struct bag_iterator_part *part;

    for (size_t i = 0; (part = bag_iterator_part(p->bag_iterator, i)); i++)
        if (part->topic == t && part->wanted)
            return true;
    return false;
}

static bool speaks(const void *ctx, const char *node, const struct topic *t)
{
    const struct playback *p = ctx;

    return !p->cfg.several_hosts &&
           (playback_publisher_has(p->playback_publisher, node, t) ||
            (subscribers_has(&p->subscribers, node) && topic_is_published_by(t, node)));
}

/* Its own launch file's nodes live in this replay, or will not start. */
static int refuse_live(const struct playback *p, const struct presence_locks *locks,
                       struct error *why)
{
    for (const char *const *n = topics_nodes(); *n; n++)
        if (strcmp(*n, "play") != 0 && strcmp(*n, "record") != 0 &&
            strcmp(*n, "view") != 0 && !is_in_launch(&p->cfg, *n) &&
            presence_of(locks, p->cfg.run_dir, *n) == PRESENCE_ALIVE &&
            !presence_replays(p->cfg.run_dir, *n))
            return error_say(why, -EADDRINUSE,
                             "%s: the node \"%s\" of a live system runs here: stop that "
                             "system, or choose another runtime directory (--run-dir)",
                             p->cfg.run_dir, *n);
    return 0;
}

static void find_subscribers(struct playback *p, const struct presence_locks *locks)
{
    subscribers_init(&p->subscribers, speaks, p);
    for (size_t i = 0; i < p->cfg.n_nodes; i++)
        if (!only_listens(p->cfg.nodes[i]))
            subscribers_expect(&p->subscribers, p->cfg.nodes[i]);
    if (!p->cfg.alone)
        return;
    for (const char *const *n = topics_nodes(); *n; n++) {
        bool ours = false;
        for (size_t i = 0; playback_publisher_node(p->playback_publisher, i); i++)
            ours |= !strcmp(playback_publisher_node(p->playback_publisher, i), *n);
        if (!ours && !only_listens(*n) &&
            presence_of(locks, p->cfg.run_dir, *n) == PRESENCE_ALIVE)
            subscribers_expect(&p->subscribers, *n);
    }
}

static int cast(struct playback *p, struct error *why)
{
    struct presence_locks locks;

    presence_read(&locks, NULL);
    int err = refuse_live(p, &locks, why);
    if (!err)
        err = check_patterns(p, p->cfg.topics, why);
    if (!err)
        err = check_patterns(p, p->cfg.exclude, why);
    if (!err)
        err = take_parts(p, why);
    if (err)
        return err;
    find_subscribers(p, &locks);
    bool dsp = subscribers_has(&p->subscribers, "dsp");
    if (dsp && plays(p, topic_ping()))
        p->flow = topic_ping();
    else if (!dsp && subscribers_has(&p->subscribers, "recon") &&
             plays(p, topic_traces()))
        p->flow = topic_traces();
    return 0;
}

/* -- what is said beyond the recording ----------------------------------------------- */

#define STATUS_PERIOD_NS 200000000LL /* as the scan node says it */

static int keep(struct kept *k, const char *node, struct bytes payload,
                int64_t publish_ns, int64_t now_ns)
{
    k->payload.size = 0;
    bytes_put(&k->payload, payload);
    snprintf(k->node, sizeof k->node, "%s", node);
    k->publish_ns = publish_ns;
    k->sent_ns = now_ns;
    return k->payload.failed ? -ENOMEM : 0;
}

static int send_kept(struct playback *p, struct kept *k, const struct topic *t,
                     int64_t now_ns)
{
    k->sent_ns = now_ns;
    return playback_publisher_publish(p->playback_publisher, k->node, t, 0, k->publish_ns,
                                      k->payload.data, k->payload.size);
}

/* The survey goes first, wherever it stands in the bag: nobody can use anything before.
 */
static int find_survey(struct playback *p, int64_t now_ns, struct error *why)
{
    struct bag_iterator_message m;
    int err = bag_iterator_find_survey(p->bag_iterator, p->at_ns, &m, why);

    if (err == -ENODATA || (!err && !m.part->wanted))
        return 0;
    if (!err && rewrite(topic_survey(), 0, 0, &m.payload, &p->rewritten))
        return 0; /* a survey that is none is found out when its turn comes */
    Anlos__Survey *s = err ? NULL
                           : anlos__survey__unpack(NULL, m.payload.size, m.payload.data);
    if (!s)
        return err;
    if (p->survey_id && s->id != p->survey_id)
        p->survey_new_ns = now_ns;
    bool known = s->id == p->survey_id;
    p->survey_id = s->id;
    p->pings_of_scan = s->n_stage_positions_m * s->n_speakers_m;
    anlos__survey__free_unpacked(s, NULL);
    if (known)
        return 0;
    /* Whoever puts messages in order must not wait with it for its time. */
    int64_t publish_ns = m.envelope.publish_ns;
    publish_ns = publish_ns < p->at_ns ? publish_ns : p->at_ns - 1;
    err = keep(&p->survey, m.part->node, m.payload, publish_ns, now_ns);
    return err ? err : send_kept(p, &p->survey, topic_survey(), now_ns);
}

static int repeat(struct playback *p, int64_t period_ns, int64_t now_ns)
{
    int err = 0;

    if (p->survey.payload.size && now_ns - p->survey.sent_ns >= period_ns)
        err = send_kept(p, &p->survey, topic_survey(), now_ns);
    if (!err && p->status.payload.size && now_ns - p->status.sent_ns >= period_ns)
        err = send_kept(p, &p->status, topic_scan_status(), now_ns);
    return err;
}

static int say_status(struct playback *p, Anlos__ScanStatus__State state,
                      const char *text, int64_t now_ns)
{
    Anlos__ScanStatus s = ANLOS__SCAN_STATUS__INIT;
    struct bytes_buffer *b = &p->rewritten;

    s.state = state;
    s.scan = p->scan;
    s.pass = p->pass;
    s.position = p->position;
    s.pings_done = (uint32_t)p->account.used;
    s.pings_lost = (uint32_t)(p->account.missing + p->account.unused);
    s.pings_expected =
        p->endless ? 0 : (uint32_t)(p->pings_of_scan * (p->background ? 2 : 1));
    s.text = (char *)text;
    if (bytes_reserve(b, anlos__scan_status__get_packed_size(&s) + 1))
        return -ENOMEM;
    b->size = anlos__scan_status__pack(&s, b->data);
    int err = keep(&p->status, "scan", bytes_in(b), p->at_ns - !p->begun, now_ns);
    return err ? err : send_kept(p, &p->status, topic_scan_status(), now_ns);
}

/* Whoever still has a scan of another replay restarts with this. */
static int say_begin(struct playback *p, int64_t now_ns)
{
    return p->says_status ? say_status(p, ANLOS__SCAN_STATUS__STATE__WAITING,
                                       "the replay begins", now_ns)
                          : 0;
}

static int say_running(struct playback *p, int64_t now_ns)
{
    if (!p->says_status || p->has_status || now_ns < p->status_due_ns)
        return 0;
    p->status_due_ns = now_ns + STATUS_PERIOD_NS;
    return say_status(p, ANLOS__SCAN_STATUS__STATE__RUNNING, p->endless ? "replay" : "",
                      now_ns);
}

/* DONE, as it was recorded, of a scan whose pings are all of no use here: whoever waits
 * for the image would wait for ever. */
static bool is_hopeless(const struct playback *p)
{
    const struct playback_next *n = &p->next;

    return n->m.part->topic == topic_scan_status() &&
           n->state == ANLOS__SCAN_STATUS__STATE__DONE && p->says_status && p->scan &&
           n->scan == p->scan && !p->scene_used &&
           subscribers_has(&p->subscribers, "recon");
}

static int say_hopeless(struct playback *p, int64_t now_ns)
{
    p->scan_ended = true;
    return say_status(p, ANLOS__SCAN_STATUS__STATE__FAILED,
                      "not one ping of the scene could be used", now_ns);
}

/* The scan has ended: waits for its list if there will be one. */
static void end_scan(struct playback *p, int64_t now_ns)
{
    if (p->scan_ended)
        return;
    p->scan_ended = true;
    if (p->scene_used && p->list_scan != p->scan &&
        subscribers_has(&p->subscribers, "recon") &&
        subscribers_has(&p->subscribers, "track"))
        p->list_since_ns = now_ns;
}

/* Of a scan that the bag begins and does not end. */
static int say_end(struct playback *p, int64_t now_ns)
{
    int err = 0;

    if (p->says_status && !p->scan_ended && p->endless && p->scene_used)
        err = say_status(p, ANLOS__SCAN_STATUS__STATE__DONE, "the recording has ended",
                         now_ns);
    else if (p->says_status && !p->scan_ended && p->has_status)
        err = say_status(p, ANLOS__SCAN_STATUS__STATE__FAILED,
                         "the recording ends before the scan did", now_ns);
    else if (p->says_status && !p->scan_ended && p->scene_used)
        err = say_status(p, ANLOS__SCAN_STATUS__STATE__DONE, "done", now_ns);
    else if (p->says_status && !p->scan_ended)
        err = say_hopeless(p, now_ns);
    end_scan(p, now_ns);
    return err;
}

/* -- the message that is to go next -------------------------------------------------- */

#define MAX_SKIPPED 256 /* in one step: a bag full of what is none must not hold it */

/* What the player has to know of the message.  -EPROTO: it is none;
 * -ENOMEM. */
static int look_into(struct playback *p, struct playback_next *n)
{
    const struct topic *t = n->m.part->topic;

    n->flow = p->flow && t == p->flow;
    if (!n->flow && t != topic_survey() && t != topic_scan_status())
        return 0;
    ProtobufCMessage *m = message_unpack(t->schema, n->m.payload.size, n->m.payload.data);
    if (!m)
        return errno == ENOMEM ? -ENOMEM : -EPROTO;
    if (t == topic_survey()) {
        n->survey_id = ((const Anlos__Survey *)m)->id;
    } else if (t == topic_scan_status()) {
        n->state = ((const Anlos__ScanStatus *)m)->state;
        n->scan = ((const Anlos__ScanStatus *)m)->scan;
    } else {
        const Anlos__Ping *ping = t == topic_ping() ? (const Anlos__Ping *)m : NULL;
        n->ping = (struct account_ping){
            .scan = (uint32_t)rewrite_peek(m, "scan"),
            .position = (uint32_t)rewrite_peek(m, "position"),
            .speaker = (uint32_t)rewrite_peek(m, "speaker"),
            .frame = (uint32_t)rewrite_peek(m, "frame"),
            .pass = ping ? ping->pass : ANLOS__PASS__SCENE,
            .valid = !ping || ping->valid,
        };
    }
    protobuf_c_message_free_unpacked(m, NULL);
    return 0;
}

/* A scan node that was started again while this was recorded counts from 1 again; the
 * nodes that hear it would take it for the scan that they have. */
static void follow_scan(struct playback *p, const struct bag_iterator_message *m)
{
    if (m->part->topic != topic_scan_status())
        return;
    if (p->scan_epoch_ns && m->envelope.epoch_ns != p->scan_epoch_ns)
        p->scan_base = p->newest_scan;
    p->scan_epoch_ns = m->envelope.epoch_ns;
}

/* Are those that the launch file runs the ones for this recording? */
static int check_mode(const struct playback *p, struct error *why)
{
    bool fixed = p->next.ping.frame > 0;

    if (!p->next.flow || p->cfg.alone || p->cfg.fixed == fixed)
        return 0;
    return error_say(why, -EINVAL,
                     fixed ? "%s: of an array that stands; expected a launch file with "
                             "scan.mode: fixed, such as launch/play-drive.yaml"
                           : "%s: of an array on a stage; expected a launch file without "
                             "scan.mode: fixed, such as launch/play.yaml",
                     p->cfg.bag_iterator.bag);
}

/* 0, -ENODATA (the end), -EAGAIN (there was much that is none: ask again), as
 * bag_iterator_next. */
static int load_next(struct playback *p, struct error *why)
{
    for (unsigned i = 0; i < MAX_SKIPPED; i++) {
        struct playback_next *n = &p->next;
        *n = (struct playback_next){.is = false};
        int err = bag_iterator_next(p->bag_iterator, &n->m, why);
        if (err)
            return err;
        follow_scan(p, &n->m);
        err = rewrite(n->m.part->topic, p->scan_base, p->survey_id, &n->m.payload,
                      &p->rewritten);
        if (!err)
            err = look_into(p, n);
        if (!err && n->m.payload.size > n->m.part->topic->max_size)
            err = -EPROTO;
        n->is = !err;
        if (err == -ENOMEM)
            return error_say(why, err, "out of memory");
        if (err != -EPROTO)
            return err ? err : check_mode(p, why);
        if (!p->malformed++)
            note(p, "%s: a message at %.3f s is no %s; it and others are left out",
                 p->cfg.bag_iterator.bag,
                 1e-9 * (double)(n->m.envelope.publish_ns -
                                 bag_iterator_start_ns(p->bag_iterator)),
                 n->m.part->topic->name);
    }
    return -EAGAIN;
}

static int after_ping(struct playback *p, const struct account_ping *ping, int64_t now_ns)
{
    if (!p->account.n)
        p->sign_ns = now_ns;
    if (ping->scan != p->scan) {
        p->scene_used = 0;
        p->scan_ended = false;
    }
    if (ping->pass != p->pass)
        p->status_due_ns = now_ns;
    p->scan = ping->scan;
    p->pass = ping->pass;
    p->position = ping->position;
    p->endless = ping->frame > 0;
    p->background |= ping->pass == ANLOS__PASS__BACKGROUND;
    if (ping->scan > p->newest_scan)
        p->newest_scan = ping->scan;
    account_play(&p->account, ping);
    return say_running(p, now_ns);
}

/* What is other when it went. */
static int went(struct playback *p, const struct playback_next *n, int64_t now_ns)
{
    const struct topic *t = n->m.part->topic;
    int64_t publish_ns = n->m.envelope.publish_ns;

    if (n->flow)
        return after_ping(p, &n->ping, now_ns);
    if (t == topic_survey()) {
        if (p->survey_id && n->survey_id != p->survey_id)
            p->survey_new_ns = now_ns;
        p->survey_id = n->survey_id;
        return keep(&p->survey, n->m.part->node, n->m.payload, publish_ns, now_ns);
    }
    if (t != topic_scan_status())
        return 0;
    if (n->scan > p->newest_scan)
        p->newest_scan = n->scan;
    if ((n->state == ANLOS__SCAN_STATUS__STATE__DONE ||
         n->state == ANLOS__SCAN_STATUS__STATE__FAILED) &&
        n->scan == p->scan)
        end_scan(p, now_ns);
    return keep(&p->status, n->m.part->node, n->m.payload, publish_ns, now_ns);
}

/* -- may it go? ---------------------------------------------------------------------- */

#define TAKEN_NS                                                                         \
    200000000LL /* a health message that comes so much later comes after it */

#define PATIENCE 4 /* timeouts: of who works on a long image, on a loaded machine */

#define LAST_LIST_NS 300000000LL
#define NEXT_LIST_NS 1000000000LL

static int64_t timeout_ns(const struct playback *p)
{
    return (int64_t)(1e9 * p->cfg.timeout_s);
}

/* Who works on a long image says nothing meanwhile; who says that it is well, long after
 * it was sent something, has had it. */
static bool have_turned(const struct playback *p, int64_t after_ns)
{
    return subscribers_heard(&p->subscribers, "dsp", after_ns) &&
           subscribers_heard(&p->subscribers, "recon", after_ns) &&
           subscribers_heard(&p->subscribers, "track", after_ns);
}

static void give_up_overdue(struct playback *p, int64_t now_ns)
{
    int64_t end_ns = p->sign_ns + timeout_ns(p);

    if (!p->account.n || now_ns < end_ns || !have_turned(p, end_ns))
        return;
    size_t n = account_give_up(&p->account);
    note(p, "%zu pings were played, and in %g s nobody said that they arrived", n,
         p->cfg.timeout_s);
}

/* true: it is here, or will not come. */
static bool has_list(struct playback *p, int64_t now_ns)
{
    if (!p->list_since_ns)
        return true;
    int64_t end_ns = p->list_since_ns + timeout_ns(p);
    if (p->list_scan == p->scan) {
        p->list_since_ns = 0;
    } else if (now_ns >= end_ns && have_turned(p, end_ns)) {
        note(p, "scan %u has ended, and in %g s there was no list of its objects",
             p->scan, p->cfg.timeout_s);
        p->list_since_ns = 0;
    }
    return !p->list_since_ns;
}

/* How far all are; what went out before is under way no more. */
static int64_t used_up_to(struct playback *p, int64_t now_ns)
{
    int64_t used_ns;
    size_t n = 0;
    struct listener *last =
        subscribers_last(&p->subscribers, p->progress_round, &used_ns);

    if (used_ns != p->used_ns || !p->used_since_ns)
        p->used_since_ns = now_ns;
    p->used_ns = used_ns;
    while (n < p->n_under_way && p->under_way[n].publish_ns <= used_ns)
        n++;
    if (n)
        p->used_since_ns = now_ns;
    p->n_under_way -= n;
    memmove(p->under_way, p->under_way + n, p->n_under_way * sizeof *p->under_way);
    if (!p->n_under_way && used_ns != INT64_MIN)
        p->used_since_ns = now_ns; /* it waits for what comes */
    int64_t end_ns = p->used_since_ns + PATIENCE * timeout_ns(p);
    if (last && now_ns >= end_ns &&
        subscribers_heard(&p->subscribers, last->name, end_ns)) {
        last->given_up = true;
        p->stopped++;
        note(p,
             "%s did not get on with the recording in %g s, and is waited "
             "for no more",
             last->name, PATIENCE * p->cfg.timeout_s);
        return used_up_to(p, now_ns);
    }
    return used_ns;
}

static void wait_for_last(struct playback *p)
{
    int64_t used_ns;
    const struct listener *last =
        subscribers_last(&p->subscribers, p->progress_round, &used_ns);

    snprintf(p->waits_for, sizeof p->waits_for, "waits for %s", last ? last->name : "");
}

/* Are all in this round?  Else waits_for has who is not. */
static bool is_entered(struct playback *p, int64_t now_ns)
{
    if (used_up_to(p, now_ns) != INT64_MIN)
        return true;
    wait_for_last(p);
    return false;
}

static bool is_used_up(struct playback *p, int64_t now_ns)
{
    int64_t used_ns = used_up_to(p, now_ns);

    if (!p->n_under_way && used_ns != INT64_MIN)
        return true;
    wait_for_last(p);
    return false;
}

/* Is every ping answered, and the list there?  For the end and for another scan. */
static bool is_settled(struct playback *p, int64_t now_ns)
{
    give_up_overdue(p, now_ns);
    if (!is_used_up(p, now_ns))
        return false;
    if (p->account.n)
        snprintf(p->waits_for, sizeof p->waits_for, "waits for %zu receipts",
                 p->account.n);
    else if (!has_list(p, now_ns))
        snprintf(p->waits_for, sizeof p->waits_for, "waits for the list of scan %u",
                 p->scan);
    else
        return true;
    return false;
}

/* Have all lists come of an array that stood?  Whoever reports ends when it is said that
 * the recording did. */
static bool has_lists(struct playback *p, int64_t now_ns)
{
    if (!p->endless || !p->scene_used || !subscribers_has(&p->subscribers, "recon") ||
        !subscribers_has(&p->subscribers, "track"))
        return true;
    if (!p->quiet_since_ns || p->lists != p->lists_then) {
        p->quiet_since_ns = now_ns;
        p->lists_then = p->lists;
    }
    uint32_t frame = p->list_scan == p->scan ? p->list_frame : 0;
    int64_t wait_ns = frame >= p->used_frame       ? LAST_LIST_NS
                      : frame + 1 >= p->used_frame ? NEXT_LIST_NS /* it may be cut */
                                                   : timeout_ns(p);
    if (now_ns - p->quiet_since_ns < wait_ns) {
        snprintf(p->waits_for, sizeof p->waits_for, "waits for the last lists");
        return false;
    }
    if (frame + 1 < p->used_frame)
        note(p, "the newest list is of frame %u, the newest ping of frame %u", frame,
             p->used_frame);
    p->quiet_since_ns = 0;
    return true;
}

static bool is_end(const struct playback_next *n)
{
    return n->m.part->topic == topic_scan_status() &&
           (n->state == ANLOS__SCAN_STATUS__STATE__DONE ||
            n->state == ANLOS__SCAN_STATUS__STATE__FAILED);
}

/* A recording that goes on with the next scan without an end of the one before. */
static bool is_other_scan(struct playback *p, int64_t now_ns)
{
    bool other = p->next.flow && p->scan && p->next.ping.scan != p->scan;

    if (other && !p->account.n && p->scene_used >= p->pings_of_scan)
        end_scan(p, now_ns);
    return other;
}

/* What fits the consumers' queues, and gets there: traces are no larger than their ping.
 */
static size_t window_of(const struct playback *p, const struct playback_next *n)
{
    size_t sure = playback_publisher_window(p->playback_publisher, n->m.part->node,
                                            n->m.part->topic, n->m.payload.size);

    return sure < p->cfg.window ? sure : p->cfg.window;
}

/* Are all so far that no more is under way than they have room for? */
static bool is_kept_up_with(struct playback *p, int64_t now_ns)
{
    int64_t used_ns = used_up_to(p, now_ns);
    size_t pings = 0, most = window_of(p, &p->next);

    for (size_t i = 0; i < p->n_under_way; i++)
        pings += p->under_way[i].flow;
    if (p->next.ping.frame && most > FRAMES_AHEAD)
        most = FRAMES_AHEAD;
    bool fits = p->n_under_way < UNDER_WAY_MAX && (!p->next.flow || pings < most);
    p->crowded = !fits && p->under_way[0].publish_ns == p->next.m.envelope.publish_ns;
    if (used_ns != INT64_MIN && fits)
        return true;
    wait_for_last(p);
    return false;
}

/* May the next message go?  Else waits_for has the reason. */
static bool may_go(struct playback *p, int64_t now_ns)
{
    const struct topic *t = p->next.m.part->topic;

    if (!is_kept_up_with(p, now_ns)) {
        give_up_overdue(p, now_ns);
        return false;
    }

    if (p->next.flow && p->account.n >= window_of(p, &p->next)) {
        give_up_overdue(p, now_ns);
        snprintf(p->waits_for, sizeof p->waits_for, "waits for %zu receipts",
                 p->account.n);
        return p->account.n < window_of(p, &p->next);
    }
    if (p->next.flow && p->survey_new_ns) {
        snprintf(p->waits_for, sizeof p->waits_for, "another survey has to be taken");
        if (!have_turned(p, p->survey_new_ns + TAKEN_NS))
            return false;
        p->survey_new_ns = 0;
    }
    bool other_survey = t == topic_survey() && p->survey_id &&
                        p->next.survey_id != p->survey_id;
    if (p->list_since_ns || is_end(&p->next) || other_survey || is_other_scan(p, now_ns))
        return is_settled(p, now_ns);
    return true;
}

/* -- the bag's time by the machine's clock ------------------------------------------- */

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

/* -- step by step -------------------------------------------------------------------- */

#define SETTLE_NS       300000000LL /* who listens already finds the new sockets by then */
#define REPEAT_NS       1000000000LL /* as the array repeats its survey */
#define REPEAT_WAITS_NS 200000000LL  /* the sooner all are ready */
#define TELL_NS         50000000LL   /* between that and the first message */
#define HOLD_NS         50000000LL   /* nothing tells that time has run out */

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
        err = cast(p, why);
    if (err) {
        playback_destroy(p);
        return err;
    }
    if (bag_iterator_foreign(p->bag_iterator))
        note(p, "%s: %zu channels are of no topic here, and are not played",
             cfg->bag_iterator.bag, bag_iterator_foreign(p->bag_iterator));
    p->at_ns = bag_iterator_start_ns(p->bag_iterator);
    p->progress_round = (uint64_t)epoch_ns; /* who hears it may have heard another play */
    p->told_ns = p->at_ns - 1;
    bag_iterator_seek(p->bag_iterator, p->at_ns);
    *out = p;
    return 0;
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
        note(p, "%s was started again: what it knew of the recording is lost", from);
    }
    if (!p->scan || p->scan_ended || (strcmp(from, "dsp") && strcmp(from, "recon")))
        return;
    account_give_up(&p->account);
    note(p, "%s was started again: what it knew of scan %u is lost; play it again", from,
         p->scan);
}

void playback_progress(struct playback *p, const char *from, const Anlos__Progress *m)
{
    uint64_t lost = subscribers_lost(&p->subscribers);

    if (subscribers_progress(&p->subscribers, from, m) && !lost && m->lost)
        note(p, "messages got lost on the way to %s; more are only counted", from);
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
        note(p,
             "a ping could not be used (scan %u, position %u, speaker %u)%s; more "
             "are only counted",
             r->scan, r->position, r->speaker,
             r->pass == ANLOS__PASS__BACKGROUND ? ": dsp has not heard its background"
                                                : "");
    if (!missing && p->account.missing)
        note(p,
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
    bool hopeless = is_hopeless(p);
    int err = 0;

    n->is = false;
    p->at_ns = e->publish_ns;
    if (hopeless)
        err = say_hopeless(p, now_ns);
    else
        err = playback_publisher_publish(p->playback_publisher, n->m.part->node,
                                         n->m.part->topic, e->capture_ns, e->publish_ns,
                                         n->m.payload.data, n->m.payload.size);
    p->messages += !err;
    p->heard = p->heard || playback_publisher_peers(p->playback_publisher,
                                                    n->m.part->node, n->m.part->topic);
    if (!err && p->n_under_way < UNDER_WAY_MAX) {
        p->under_way[p->n_under_way].publish_ns = p->at_ns;
        p->under_way[p->n_under_way++].flow = n->flow;
    }
    if (!err && !hopeless)
        err = went(p, n, now_ns);
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
    if (!told || !is_entered(p, now_ns))
        return -EAGAIN;
    p->enters = false;
    return find_survey(p, now_ns, why);
}

/* -EAGAIN: not yet. */
static int finish(struct playback *p, int64_t now_ns, struct error *why)
{
    if (!is_settled(p, now_ns) || (!p->scan_ended && !has_lists(p, now_ns)))
        return -EAGAIN;
    if (p->scan && !p->scan_ended) {
        int err = say_end(p, now_ns);
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
    int err = find_survey(p, now_ns, why);
    if (!err && (err = say_begin(p, now_ns)))
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
        err = repeat(p, 0, now_ns);
        if (p->begin_ns < now_ns + TELL_NS)
            p->begin_ns = now_ns + TELL_NS;
    }
    p->ready = ready;
    p->begun = ready && now_ns >= p->begin_ns;
    if (!err && !p->begun)
        err = repeat(p, REPEAT_WAITS_NS, now_ns);
    return err ? err : p->begun ? 0 : -EAGAIN;
}

/* The next message, if it may go now. */
static int advance(struct playback *p, int64_t now_ns, int64_t *due_ns, struct error *why)
{
    int64_t publish_ns = p->next.m.envelope.publish_ns;

    p->waits_for[0] = '\0';
    if (p->paused && !p->ones)
        return repeat(p, REPEAT_NS, now_ns);
    int64_t at = p->ones ? now_ns : tempo_due_ns(&p->tempo, publish_ns, now_ns);
    if (at > now_ns) {
        *due_ns = at < *due_ns ? at : *due_ns;
        return repeat(p, REPEAT_NS, now_ns);
    }
    if (!may_go(p, now_ns)) {
        tempo_set(&p->tempo, publish_ns, now_ns); /* what it waits is not made up for */
        return repeat(p, REPEAT_NS, now_ns);
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
        return repeat(p, REPEAT_NS, now_ns);
    }
    if (!err && !p->next.is && !p->bag_iterator_ended) {
        err = load_next(p, why);
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
        .heard = p->heard,
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
