/* SPDX-License-Identifier: MIT */
#include "nodes/play/run.h"

#include <errno.h>
#include <inttypes.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>

#include "dsp/error.h"
#include "msgs/clock.pb-c.h"

#define CLOCK_PERIOD_NS 200000000LL
#define MOST_MS         50
#define MOST_AT_ONCE    64 /* messages taken before the next one is played */

struct run {
    struct node *node;
    struct playback *player;
    const struct play_control *control;
    struct playback_status said; /* by the clock, last */
    int64_t clock_due_ns;
};

static int subscribe(const struct run *r)
{
    const struct topic *const topics[] = {topic_health(), topic_receipt(),
                                          topic_detections(), topic_progress(),
                                          topic_traces()};
    size_t n = playback_wants_traces(r->player) ? 5 : 4;
    int err = 0;

    for (size_t i = 0; i < n && !err; i++)
        err = node_subscribe(r->node, topics[i]);
    return err;
}

/* Are those connected here whose answers are waited for? */
static bool hears_all(const struct run *r)
{
    struct bus_count counts[32];
    size_t n = node_counts(r->node, counts, 32);

    for (size_t i = 0; i < n && i < 32; i++)
        if (!counts[i].published && counts[i].topic != topic_health() &&
            counts[i].peers < playback_speakers(r->player, counts[i].topic))
            return false;
    return true;
}

static bool is_own(const struct run *r, const char *from)
{
    const char *name;

    for (size_t i = 0; (name = playback_stands_for(r->player, i)); i++)
        if (!strcmp(name, from))
            return true;
    return false;
}

static void take(const struct run *r, const struct node_message *in, int64_t now_ns)
{
    if (is_own(r, in->from))
        return;
    if (in->topic == topic_health())
        playback_health(r->player, in->from, in->epoch_ns,
                        (const Anlos__Health *)in->content, now_ns);
    else if (in->topic == topic_receipt())
        playback_receipt(r->player, (const Anlos__Receipt *)in->content, now_ns);
    else if (in->topic == topic_progress())
        playback_progress(r->player, in->from, (const Anlos__Progress *)in->content);
    else if (in->topic == topic_detections())
        playback_list(r->player, (const Anlos__DetectionList *)in->content);
    else if (in->topic == topic_traces())
        playback_traces(r->player, (const Anlos__Traces *)in->content, now_ns);
}

static int take_all(const struct run *r)
{
    struct node_message in;
    int err = 0;

    for (unsigned i = 0; i < MOST_AT_ONCE && !err; i++) {
        err = node_next(r->node, &in, 0);
        if (!err)
            take(r, &in, node_machine_ns(r->node));
    }
    return err == -ETIMEDOUT ? 0 : err;
}

static void say_clock(struct run *r, const struct playback_status *s, int64_t now_ns)
{
    Anlos__Clock c = ANLOS__CLOCK__INIT;
    bool news = s->phase != r->said.phase || s->rate != r->said.rate;

    if (!news && now_ns < r->clock_due_ns)
        return;
    r->clock_due_ns = now_ns + CLOCK_PERIOD_NS;
    r->said = *s;
    c.time_ns = s->at_ns;
    c.rate = s->rate;
    c.paused = s->phase == PLAYBACK_PAUSES;
    c.ended = s->phase == PLAYBACK_ENDED;
    c.start_ns = s->start_ns;
    c.end_ns = s->end_ns;
    c.bag = (char *)playback_bag(r->player);
    node_publish(r->node, topic_clock(), 0, &c.base);
}

static void say_progress(const struct run *r, int64_t now_ns)
{
    Anlos__Progress p;
    Anlos__Sent sent[MOST_AT_ONCE], *list[MOST_AT_ONCE];
    char *nodes[MOST_AT_ONCE];

    if (playback_tells(r->player, &p, sent, list, nodes, MOST_AT_ONCE, now_ns))
        node_publish(r->node, topic_progress(), 0, &p.base);
}

static void say_state(const struct run *r, const struct playback_status *s)
{
    const uint64_t lost = s->pings.missing + s->pings.unused;

    if (s->phase == PLAYBACK_WAITS)
        node_state(r->node, ANLOS__HEALTH__STATE__STARTING, "%s", s->text);
    else if (lost || s->lost)
        node_state(r->node, ANLOS__HEALTH__STATE__DEGRADED,
                   "pings without a use: %" PRIu64 ", without a receipt: %" PRIu64
                   ", messages lost: %" PRIu64,
                   s->pings.unused, s->pings.missing, s->lost);
    else
        node_state(r->node, ANLOS__HEALTH__STATE__READY, "%s",
                   s->phase == PLAYBACK_ENDED    ? "the bag has ended"
                   : s->phase == PLAYBACK_PAUSES ? "pauses"
                                                 : "plays");
}

static void say(struct run *r, int64_t now_ns)
{
    struct playback_status s;
    const char *note = playback_note(r->player);

    if (note)
        node_log(r->node, LOG_LEVEL_WARNING, "%s", note);
    playback_status(r->player, &s);
    say_clock(r, &s, now_ns);
    say_state(r, &s);
    if (r->control && r->control->show)
        r->control->show(r->control->ctx, &s);
}

/* Until a message or a key comes, or it is due. */
static int wait(const struct run *r, int64_t due_ns)
{
    int64_t left_ns = due_ns - node_machine_ns(r->node);
    int fd = r->control ? r->control->fd : -1;
    struct pollfd fds[] = {{.fd = node_fd(r->node), .events = POLLIN},
                           {.fd = fd, .events = POLLIN}};
    int ms = left_ns >= MOST_MS * 1000000LL ? MOST_MS
                                            : (int)((left_ns + 999999) / 1000000);

    if (poll(fds, 2, ms > 0 ? ms : 0) > 0 && fds[1].revents)
        return r->control->read(r->control->ctx, r->player, node_machine_ns(r->node));
    return 0;
}

static size_t counts(void *device, struct device_count *out)
{
    struct playback_status s;

    playback_status(device, &s);
    out[0] = (struct device_count){"messages", s.messages};
    out[1] = (struct device_count){"messages_malformed", s.malformed};
    out[2] = (struct device_count){"pings", s.pings.played};
    out[3] = (struct device_count){"pings_used", s.pings.used};
    out[4] = (struct device_count){"pings_unused", s.pings.unused};
    out[5] = (struct device_count){"pings_missing", s.pings.missing};
    return 6;
}

_Static_assert(DEVICE_MAX_COUNTS >= 6, "no room");

static int loop(struct run *r, bool stays)
{
    struct playback_status s;
    struct error why = {""};
    int64_t due_ns = 0;
    bool told = false;
    int err = subscribe(r);

    while (!err) {
        playback_hears(r->player, hears_all(r));
        int64_t now_ns = node_machine_ns(r->node);
        err = playback_step(r->player, now_ns, &due_ns, &why);
        say_progress(r, now_ns);
        say(r, now_ns);
        playback_status(r->player, &s);
        if (!err && s.phase == PLAYBACK_ENDED && !told) {
            char text[200];
            told = true;
            play_summary(&s, text, sizeof text);
            node_log(r->node, LOG_LEVEL_INFO, "%s", text);
        }
        if (!err && s.phase == PLAYBACK_ENDED && !stays)
            return 0;
        if (!err)
            err = wait(r, due_ns);
        if (!err)
            err = take_all(r);
    }
    if (err != -ESHUTDOWN)
        node_log(r->node, LOG_LEVEL_ERROR, "%s", why.text[0] ? why.text : strerror(-err));
    playback_status(r->player, &s);
    if (err == -ESHUTDOWN && stays && (s.lost || s.pings.missing)) {
        node_log(r->node, LOG_LEVEL_ERROR,
                 "a part of the recording was skipped: %" PRIu64
                 " pings without a receipt, %" PRIu64 " losses on the way: play it again",
                 s.pings.missing, s.lost);
        err = -EIO;
    }
    return err;
}

int play_run(struct node *node, struct playback *p, const struct play_control *control,
             bool stays)
{
    struct run r = {.node = node, .player = p, .control = control};

    node_device(node, counts, p);
    int err = loop(&r, stays);
    node_device(node, NULL, NULL);
    return err;
}

void play_summary(const struct playback_status *s, char *text, size_t size)
{
    snprintf(text, size, "%" PRIu64 " messages of %.1f s", s->messages,
             1e-9 * (double)(s->end_ns - s->start_ns));
    if (s->pings.played)
        text_add(text, size, "; ",
                 "%" PRIu64 " pings, %" PRIu64 " used, %" PRIu64
                 " without a use, %" PRIu64 " without a receipt; %" PRIu64 " list%s",
                 s->pings.played, s->pings.used, s->pings.unused, s->pings.missing,
                 s->lists, s->lists == 1 ? "" : "s");
    if (s->lost)
        text_add(text, size, "; ", "%" PRIu64 " lost on the way", s->lost);
    if (s->malformed)
        text_add(text, size, "; ", "%" PRIu64 " that were none, left out", s->malformed);
}
