/* SPDX-License-Identifier: MIT */
#include "nodes/foxglove/server.h"

#include <errno.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "msgs/unpack.h"
#include "nodes/foxglove/channels.h"
#include "nodes/foxglove/queue.h"
#include "nodes/foxglove/request.h"
#include "nodes/rt/setting.h"

/* The inside of a server: its clients, and the thread that converts.  One lock guards
 * all of it; nobody holds it while he converts. */

struct subscription { /* of a client to a channel */
    bool active;
    bool told; /* that it is too slow */
    uint32_t id;
};

struct client {
    struct foxglove_server *server;
    struct client *next;
    uint64_t serial; /* from 1, of no other client before */
    struct queue queue;
    struct subscription *subscriptions; /* [n_channels] */
    bool time_waits;                    /* the server's time is to be sent */
    bool goodbye;                       /* to be said as soon as may be */
};

struct foxglove_server {
    struct foxglove_config cfg;
    struct web *web;
    size_t n_channels;
    struct blob *info; /* the first thing that a client hears */

    pthread_mutex_t lock;
    pthread_cond_t work;   /* for the thread that converts */
    pthread_cond_t parted; /* a client has gone */
    bool *offered;         /* [n_channels]: something of it has come */
    bool *named;           /* [n_channels]: to be told now */
    struct client *clients;
    uint64_t n_ever; /* clients */
    struct foxglove_counts counts;
    bool stopping;
    int64_t time_ns, time_sent_ms; /* by the system's time; by the machine's */
    struct arrival *newest;        /* [n_topics]; payload NULL: none */
    struct inbox inbox;

    pthread_t press;
    bool presses;           /* the thread that converts has not been ended */
    struct setting setting; /* of the thread that converts alone */
};

static size_t topic_index(const struct topic *t)
{
    return (size_t)(t - topics_all());
}

static void push_newest(struct foxglove_server *s, const struct topic *t, uint64_t client,
                        size_t channel)
{
    struct arrival late = s->newest[topic_index(t)];

    if (!late.payload)
        return;
    late.client = client;
    late.channel = channel;
    blob_hold(late.payload);
    s->counts.skipped += inbox_push(&s->inbox, &late) < 0;
    pthread_cond_signal(&s->work);
}

/* With the lock: the newest messages of a channel's topics, for a client that has just
 * subscribed to it. */
static void press_late(struct foxglove_server *s, const struct client *c, size_t channel)
{
    struct channel ch;

    channel_get(channel, &ch);
    for (size_t i = 0; i < CHANNEL_MAX_SOURCES && ch.sources[i]; i++)
        push_newest(s, ch.sources[i], c->serial, channel);
}

static bool wants(const struct client *c, const struct arrival *a, size_t channel)
{
    return c->subscriptions[channel].active &&
           (!a->client || (a->client == c->serial && a->channel == channel));
}

static bool is_wanted(struct foxglove_server *s, const struct arrival *a, size_t channel)
{
    bool wanted = false;

    pthread_mutex_lock(&s->lock);
    for (const struct client *c = s->clients; c && !wanted; c = c->next)
        wanted = wants(c, a, channel);
    pthread_mutex_unlock(&s->lock);
    return wanted;
}

static void client_push(struct client *c, const struct outgoing *o);

static void give(struct foxglove_server *s, const struct arrival *a, size_t channel,
                 struct blob *b)
{
    pthread_mutex_lock(&s->lock);
    for (struct client *c = s->clients; c; c = c->next) {
        if (!wants(c, a, channel))
            continue;
        const struct outgoing o = {OUTGOING_MESSAGE, blob_hold(b), channel,
                                   c->subscriptions[channel].id, a->publish_ns};
        client_push(c, &o);
    }
    pthread_mutex_unlock(&s->lock);
}

static void count_failure(struct foxglove_server *s)
{
    pthread_mutex_lock(&s->lock);
    s->counts.failed++;
    pthread_mutex_unlock(&s->lock);
}

/* NULL: there is none, or not yet. */
static struct blob *convert(struct foxglove_server *s, const struct channel *c,
                            const struct foxglove_message *m, struct blob *payload)
{
    uint8_t *data = NULL;
    size_t size;

    if (!c->convert)
        return blob_hold(payload);
    int err = channel_pack(c, &s->setting, m, &data, &size);
    struct blob *b = err ? NULL : blob_create(data, size);
    if (!b && err != -EAGAIN)
        count_failure(s);
    return b;
}

static void work_off(struct foxglove_server *s, const struct arrival *a)
{
    struct foxglove_message m = {.topic = a->topic,
                                 .node = a->node,
                                 .capture_ns = a->capture_ns,
                                 .publish_ns = a->publish_ns};
    ProtobufCMessage *content =
        message_unpack(a->topic->schema, a->payload->size, a->payload->data);
    struct channel c;

    m.content = content;
    if (!content) {
        count_failure(s);
        return;
    }
    if (setting_take(&s->setting, &m)) { /* an image may have come before its survey */
        pthread_mutex_lock(&s->lock);
        push_newest(s, topic_volume(), 0, 0);
        pthread_mutex_unlock(&s->lock);
    }
    for (size_t i = 0; i < s->n_channels; i++) {
        channel_get(i, &c);
        if (!channel_is_from(&c, a->topic) || !is_wanted(s, a, i))
            continue;
        struct blob *b = convert(s, &c, &m, a->payload);
        if (b)
            give(s, a, i, b);
        blob_release(b);
    }
    protobuf_c_message_free_unpacked(content, NULL);
}

/* The thread that converts; data is the server. */
static void *press_run(void *data)
{
    struct foxglove_server *s = data;
    struct arrival a;

    pthread_mutex_lock(&s->lock);
    for (;;) {
        while (!s->stopping && !s->inbox.first)
            pthread_cond_wait(&s->work, &s->lock);
        if (s->stopping)
            break;
        inbox_pop(&s->inbox, &a);
        pthread_mutex_unlock(&s->lock);
        work_off(s, &a);
        blob_release(a.payload);
        pthread_mutex_lock(&s->lock);
    }
    pthread_mutex_unlock(&s->lock);
    return NULL;
}

static void client_status(struct client *c, enum reply_level level, const char *text);

/* With the lock: n messages of the channel have been left out. */
static void count_dropped(struct client *c, size_t channel, uint64_t n)
{
    struct subscription *s = &c->subscriptions[channel];
    struct error told;
    struct channel about;

    c->server->counts.dropped += n;
    if (s->told)
        return;
    s->told = true;
    channel_get(channel, &about);
    error_say(
        &told, 0,
        "%s: this connection is too slow for it; what finds no place in the queue is "
        "left out",
        about.name);
    client_status(c, REPLY_WARNING, told.text);
}

/* The total of what waits is bounded too, at the cost of who has most. */
static void keep_within(struct foxglove_server *s)
{
    for (;;) {
        struct client *most = NULL;
        size_t bytes = 0, channel;
        for (struct client *c = s->clients; c; c = c->next) {
            bytes += c->queue.bytes;
            if (c->queue.messages > 1 && (!most || c->queue.bytes > most->queue.bytes))
                most = c;
        }
        if (bytes <= s->cfg.total_bytes || !most || !queue_drop(&most->queue, &channel))
            return;
        count_dropped(most, channel, 1);
    }
}

/* With the lock: something for a client to send.  Takes over what it holds. */
static void client_push(struct client *c, const struct outgoing *o)
{
    int dropped = queue_push(&c->queue, o);

    web_wake(c->server->web);
    if (o->kind == OUTGOING_TEXT) {
        c->server->counts.dropped += dropped != 0;
        return;
    }
    if (dropped)
        count_dropped(c, o->channel, dropped < 0 ? 1 : (uint64_t)dropped);
    keep_within(c->server);
}

static void client_status(struct client *c, enum reply_level level, const char *text)
{
    const struct outgoing o = {.kind = OUTGOING_TEXT, .blob = reply_status(level, text)};

    if (o.blob)
        client_push(c, &o);
}

/* 0, -EINVAL. */
static int subscribe(struct client *c, const struct foxglove_wish *w, struct error *why)
{
    struct foxglove_server *s = c->server;

    if (w->channel >= s->n_channels || !s->offered[w->channel])
        return error_say(why, -EINVAL, "subscribe: there is no channel %u", w->channel);
    if (c->subscriptions[w->channel].active)
        return error_say(why, -EINVAL, "subscribe: channel %u is subscribed to already",
                         w->channel);
    for (size_t i = 0; i < s->n_channels; i++)
        if (c->subscriptions[i].active && c->subscriptions[i].id == w->subscription)
            return error_say(why, -EINVAL,
                             "subscribe: id %u is that of another subscription",
                             w->subscription);
    c->subscriptions[w->channel] =
        (struct subscription){.active = true, .id = w->subscription};
    press_late(s, c, w->channel);
    return 0;
}

static int unsubscribe(struct client *c, const struct foxglove_wish *w, struct error *why)
{
    for (size_t i = 0; i < c->server->n_channels; i++) {
        if (!c->subscriptions[i].active || c->subscriptions[i].id != w->subscription)
            continue;
        c->subscriptions[i].active = false;
        queue_forget(&c->queue, i);
        return 0;
    }
    return error_say(why, -EINVAL, "unsubscribe: there is no subscription %u",
                     w->subscription);
}

/* Carries out what can be; the first thing that cannot is in the error.  How many
 * cannot. */
static size_t carry_out(struct client *c, const struct foxglove_request *r,
                        struct error *first)
{
    struct error why;
    size_t wrong = 0;

    for (size_t i = 0; i < r->n; i++) {
        int err = r->operation == FOXGLOVE_SUBSCRIBE
                      ? subscribe(c, &r->wishes[i], &why)
                      : unsubscribe(c, &r->wishes[i], &why);
        if (err && !wrong++)
            *first = why;
    }
    return wrong;
}

/* With the lock. */
static void answer(struct client *c, const void *data, size_t size, bool binary)
{
    struct foxglove_request request;
    struct error why = {""};
    int err = foxglove_request_parse(data, size, binary, &request, &why);
    size_t wrong = err ? 1 : carry_out(c, &request, &why);

    c->server->counts.rejected += wrong;
    if (wrong)
        client_status(c, REPLY_ERROR, why.text);
    if (!err)
        foxglove_request_clear(&request);
}

static bool client_take(void *client, const void *data, size_t size, bool binary)
{
    struct client *c = client;

    pthread_mutex_lock(&c->server->lock);
    if (data) {
        answer(c, data, size, binary);
    } else {
        c->server->counts.rejected++;
        client_status(c, REPLY_ERROR, "a request that is too long");
    }
    pthread_mutex_unlock(&c->server->lock);
    return true;
}

/* With the lock. */
static enum web_next next(struct client *c, struct web_frame *out)
{
    struct outgoing o;

    *out = (struct web_frame){.binary = true};
    if (c->goodbye)
        return WEB_GOODBYE;
    if (c->time_waits) {
        c->time_waits = false;
        reply_time(out->head, c->server->time_ns);
        out->head_size = REPLY_TIME_SIZE;
        return WEB_FRAME;
    }
    if (!queue_pop(&c->queue, &o))
        return WEB_NOTHING;
    out->owner = o.blob;
    out->body = o.blob->data;
    out->body_size = o.blob->size;
    out->binary = o.kind == OUTGOING_MESSAGE;
    if (out->binary) {
        reply_message_head(out->head, o.subscription, o.t_ns);
        out->head_size = REPLY_MESSAGE_HEAD;
    }
    return WEB_FRAME;
}

static enum web_next client_next(void *client, struct web_frame *out)
{
    struct client *c = client;

    pthread_mutex_lock(&c->server->lock);
    enum web_next n = next(c, out);
    pthread_mutex_unlock(&c->server->lock);
    return n;
}

static void client_done(void *client, const struct web_frame *f, bool sent)
{
    struct foxglove_server *s = ((struct client *)client)->server;

    pthread_mutex_lock(&s->lock);
    s->counts.sent += sent && f->owner && f->binary;
    pthread_mutex_unlock(&s->lock);
    blob_release(f->owner);
}

static const char *const foxglove_subprotocols[] = {"foxglove.sdk.v1",
                                                    "foxglove.websocket.v1", NULL};

static bool speaks_foxglove(const char *offered)
{
    const char *at = offered ? offered : "";

    while (at += strspn(at, ", \t"), *at) {
        size_t n = strcspn(at, ", \t");
        for (const char *const *known = foxglove_subprotocols; *known; known++)
            if (n == strlen(*known) && !strncmp(at, *known, n))
                return true;
        at += n;
    }
    return false;
}

static bool reply(struct web_reply *out, const char *status, const char *text)
{
    *out = (struct web_reply){
        .status = status, .type = "text/plain", .data = text, .size = strlen(text)};
    return true;
}

static bool client_refuse(void *server, const struct web_request *r,
                          struct web_reply *out)
{
    struct foxglove_server *s = server;
    bool foreign = !origin_is_allowed(r->origin, r->host);
    bool mute = !speaks_foxglove(r->subprotocols);

    pthread_mutex_lock(&s->lock);
    bool full = s->stopping || s->counts.clients >= s->cfg.max_clients;
    s->counts.refused += foreign || mute || full;
    pthread_mutex_unlock(&s->lock);
    if (foreign)
        return reply(out, "403 Forbidden", "a page of another site may not connect\n");
    if (mute)
        return reply(out, "400 Bad Request",
                     "the subprotocol has to be foxglove.sdk.v1 or "
                     "foxglove.websocket.v1\n");
    return full && reply(out, "503 Service Unavailable", "too many clients\n");
}

static void client_free(struct client *c)
{
    if (!c)
        return;
    queue_clear(&c->queue);
    free(c->subscriptions);
    free(c);
}

static struct client *client_create(struct foxglove_server *s)
{
    struct client *c = calloc(1, sizeof *c);

    if (!c)
        return NULL;
    c->server = s;
    c->queue.max_bytes = s->cfg.queue_bytes;
    c->queue.max_messages = s->cfg.queue_messages;
    c->subscriptions = calloc(s->n_channels, sizeof *c->subscriptions);
    if (c->subscriptions)
        return c;
    client_free(c);
    return NULL;
}

/* With the lock.  0, -ENOMEM. */
static int client_start(struct client *c)
{
    struct foxglove_server *s = c->server;
    struct blob *channels = reply_advertise(s->offered);
    const struct outgoing first[] = {
        {.kind = OUTGOING_TEXT, .blob = blob_hold(s->info)},
        {.kind = OUTGOING_TEXT, .blob = channels},
    };

    for (size_t i = 0; i < 1u + (channels != NULL); i++)
        client_push(c, &first[i]);
    if (!channels)
        return -ENOMEM;
    c->serial = ++s->n_ever;
    c->time_waits = s->time_ns != 0;
    c->next = s->clients;
    s->clients = c;
    s->counts.clients++;
    return 0;
}

static void *client_open(void *server)
{
    struct foxglove_server *s = server;
    struct client *c = client_create(s);
    bool started = false;

    pthread_mutex_lock(&s->lock);
    if (c && !s->stopping && s->counts.clients < s->cfg.max_clients)
        started = !client_start(c);
    s->counts.refused += !started;
    pthread_mutex_unlock(&s->lock);
    if (started)
        return c;
    client_free(c);
    return NULL;
}

static void client_close(void *client)
{
    struct client *c = client;
    struct foxglove_server *s = c->server;

    pthread_mutex_lock(&s->lock);
    struct client **link = &s->clients;
    while (*link != c)
        link = &(*link)->next;
    *link = c->next;
    s->counts.clients--;
    pthread_cond_broadcast(&s->parted);
    pthread_mutex_unlock(&s->lock);
    client_free(c);
}

#define PATH           "/"
#define TIME_PERIOD_MS 50
#define PARTING_MS     300
#define NS_PER_MS      1000000LL

void foxglove_config_default(struct foxglove_config *cfg, int64_t now_ns)
{
    *cfg = (struct foxglove_config){.name = "anlos",
                                    .session_ns = now_ns,
                                    .max_clients = 8,
                                    .queue_bytes = (size_t)8 << 20,
                                    .total_bytes = (size_t)16 << 20,
                                    .queue_messages = 1024};
}

static void free_server(struct foxglove_server *s)
{
    inbox_clear(&s->inbox);
    for (size_t i = 0; s->newest && i < TOPICS_COUNT; i++)
        blob_release(s->newest[i].payload);
    free(s->newest);
    setting_clear(&s->setting);
    free(s->offered);
    free(s->named);
    blob_release(s->info);
    pthread_cond_destroy(&s->work);
    pthread_cond_destroy(&s->parted);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

/* Waits are by the machine's clock, whatever happens to the wall's. */
static void open_locks(struct foxglove_server *s)
{
    pthread_condattr_t attributes;

    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_mutex_init(&s->lock, NULL);
    pthread_cond_init(&s->work, NULL);
    pthread_cond_init(&s->parted, &attributes);
    pthread_condattr_destroy(&attributes);
}

int foxglove_server_create(struct foxglove_server **out, struct web *web,
                           const struct foxglove_config *cfg)
{
    struct foxglove_server *s = calloc(1, sizeof *s);
    const struct web_endpoint endpoint = {.path = PATH,
                                          .subprotocols = foxglove_subprotocols,
                                          .max_message = FOXGLOVE_REQUEST_MAX_SIZE,
                                          .ctx = s,
                                          .refuse = client_refuse,
                                          .open = client_open,
                                          .take = client_take,
                                          .next = client_next,
                                          .done = client_done,
                                          .close = client_close};

    if (!s)
        return -ENOMEM;
    open_locks(s);
    s->cfg = *cfg;
    s->web = web;
    s->n_channels = channels_count();
    s->info = reply_server_info(cfg->name, cfg->session_ns);
    s->offered = calloc(s->n_channels, sizeof *s->offered);
    s->named = calloc(s->n_channels, sizeof *s->named);
    s->newest = calloc(TOPICS_COUNT, sizeof *s->newest);
    int err = !s->info || !s->offered || !s->named || !s->newest
                  ? -ENOMEM
                  : -pthread_create(&s->press, NULL, press_run, s);
    if (err) {
        free_server(s);
        return err;
    }
    s->presses = true;
    web_serve(web, &endpoint);
    *out = s;
    return 0;
}

static struct blob *payload_of(const struct foxglove_message *m)
{
    if (m->payload)
        return blob_copy(m->payload, m->payload_size);
    size_t size = protobuf_c_message_get_packed_size(m->content);
    uint8_t *data = malloc(size ? size : 1);
    if (data)
        protobuf_c_message_pack(m->content, data);
    return blob_create(data, size);
}

/* With the lock: does a client want anything that is made of it? */
static bool server_is_wanted(const struct foxglove_server *s, const struct topic *t)
{
    struct channel channel;

    for (size_t i = 0; i < s->n_channels; i++) {
        channel_get(i, &channel);
        if (!channel_is_from(&channel, t))
            continue;
        for (const struct client *c = s->clients; c; c = c->next)
            if (c->subscriptions[i].active)
                return true;
    }
    return false;
}

/* State, and the result of each scan: who subscribes late gets the newest. */
static bool is_kept(const struct topic *t)
{
    return t->policy == TOPIC_LATEST || t == topic_detections();
}

static bool is_setting(const struct topic *t)
{
    return t == topic_survey() || t == topic_stage_state() || t == topic_wall();
}

/* With the lock: names the channels that this topic's first message opens to everybody.
 */
static void offer(struct foxglove_server *s, const struct topic *t)
{
    struct channel channel;

    for (size_t i = 0; i < s->n_channels; i++) {
        channel_get(i, &channel);
        s->named[i] = !s->offered[i] && channel_is_from(&channel, t);
        s->offered[i] = s->offered[i] || s->named[i];
    }
    struct blob *b = s->clients ? reply_advertise(s->named) : NULL;
    for (struct client *c = s->clients; b && c; c = c->next) {
        const struct outgoing o = {.kind = OUTGOING_TEXT, .blob = blob_hold(b)};
        client_push(c, &o);
    }
    blob_release(b);
}

void foxglove_server_message(struct foxglove_server *s, const struct foxglove_message *m)
{
    struct arrival a = {
        .topic = m->topic, .capture_ns = m->capture_ns, .publish_ns = m->publish_ns};
    struct arrival *newest = &s->newest[m->topic - topics_all()];

    pthread_mutex_lock(&s->lock);
    if (!s->offered[m->topic - topics_all()]) /* which is the channel of the topic */
        offer(s, m->topic);
    bool wanted = server_is_wanted(s, m->topic) || is_setting(m->topic);
    pthread_mutex_unlock(&s->lock);
    if (!wanted && !is_kept(m->topic))
        return;
    snprintf(a.node, sizeof a.node, "%s", m->node);
    a.payload = payload_of(m);
    pthread_mutex_lock(&s->lock);
    if (a.payload && is_kept(m->topic)) {
        blob_release(newest->payload);
        *newest = a;
        blob_hold(a.payload);
    }
    int skipped = !a.payload ? -ENOMEM : wanted ? inbox_push(&s->inbox, &a) : 0;
    if (!wanted)
        blob_release(a.payload);
    s->counts.skipped += skipped < 0 ? 1 : (uint64_t)skipped;
    pthread_cond_signal(&s->work);
    pthread_mutex_unlock(&s->lock);
}

static struct timespec after_ms(int64_t ms)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    int64_t ns = t.tv_nsec + ms * NS_PER_MS;
    t.tv_sec += ns / (1000 * NS_PER_MS);
    t.tv_nsec = ns % (1000 * NS_PER_MS);
    return t;
}

void foxglove_server_time(struct foxglove_server *s, int64_t now_ns)
{
    struct timespec t = after_ms(0);
    int64_t ms = t.tv_sec * 1000 + t.tv_nsec / NS_PER_MS;

    pthread_mutex_lock(&s->lock);
    if (now_ns != s->time_ns && ms - s->time_sent_ms >= TIME_PERIOD_MS) {
        s->time_ns = now_ns;
        s->time_sent_ms = ms;
        for (struct client *c = s->clients; c; c = c->next) {
            c->time_waits = true;
            web_wake(s->web);
        }
    }
    pthread_mutex_unlock(&s->lock);
}

void foxglove_server_counts(struct foxglove_server *s, struct foxglove_counts *out)
{
    pthread_mutex_lock(&s->lock);
    *out = s->counts;
    for (const struct client *c = s->clients; c; c = c->next)
        out->waiting += c->queue.bytes;
    pthread_mutex_unlock(&s->lock);
}

/* It wakes the web server, which may be gone after foxglove_server_stop. */
static void end_press(struct foxglove_server *s)
{
    pthread_mutex_lock(&s->lock);
    s->stopping = true;
    pthread_cond_signal(&s->work);
    pthread_mutex_unlock(&s->lock);
    if (s->presses)
        pthread_join(s->press, NULL);
    s->presses = false;
}

void foxglove_server_stop(struct foxglove_server *s)
{
    const struct timespec end = after_ms(PARTING_MS);
    int err = 0;

    end_press(s);
    pthread_mutex_lock(&s->lock);
    for (struct client *c = s->clients; c; c = c->next) {
        c->goodbye = true;
        web_wake(s->web);
    }
    while (s->counts.clients && !err)
        err = pthread_cond_timedwait(&s->parted, &s->lock, &end);
    pthread_mutex_unlock(&s->lock);
}

void foxglove_server_destroy(struct foxglove_server *s)
{
    if (!s)
        return;
    end_press(s);
    free_server(s);
}
