/* A client from its handshake to its end: what it asks for, and what it is sent. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/foxglove/channels.h"
#include "nodes/foxglove/origin.h"
#include "nodes/foxglove/server_state.h"

/* With the lock: n messages of the channel have been left out. */
static void count_dropped(struct client *c, size_t channel, uint64_t n)
{
    struct subscription *s = &c->subscriptions[channel];
    struct complaint told;
    struct channel about;

    c->server->counts.dropped += n;
    if (s->told)
        return;
    s->told = true;
    channel_get(channel, &about);
    complain(
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

void client_push(struct client *c, const struct outgoing *o)
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

void client_status(struct client *c, enum reply_level level, const char *text)
{
    const struct outgoing o = {.kind = OUTGOING_TEXT, .blob = reply_status(level, text)};

    if (o.blob)
        client_push(c, &o);
}

/* 0, -EINVAL. */
static int subscribe(struct client *c, const struct foxglove_wish *w,
                     struct complaint *why)
{
    struct foxglove_server *s = c->server;

    if (w->channel >= s->n_channels || !s->offered[w->channel])
        return complain(why, -EINVAL, "subscribe: there is no channel %u", w->channel);
    if (c->subscriptions[w->channel].active)
        return complain(why, -EINVAL, "subscribe: channel %u is subscribed to already",
                        w->channel);
    for (size_t i = 0; i < s->n_channels; i++)
        if (c->subscriptions[i].active && c->subscriptions[i].id == w->subscription)
            return complain(why, -EINVAL,
                            "subscribe: id %u is that of another subscription",
                            w->subscription);
    c->subscriptions[w->channel] =
        (struct subscription){.active = true, .id = w->subscription};
    press_late(s, c, w->channel);
    return 0;
}

static int unsubscribe(struct client *c, const struct foxglove_wish *w,
                       struct complaint *why)
{
    for (size_t i = 0; i < c->server->n_channels; i++) {
        if (!c->subscriptions[i].active || c->subscriptions[i].id != w->subscription)
            continue;
        c->subscriptions[i].active = false;
        queue_forget(&c->queue, i);
        return 0;
    }
    return complain(why, -EINVAL, "unsubscribe: there is no subscription %u",
                    w->subscription);
}

/* Carries out what can be; the first thing that cannot is in the complaint.  How many
 * cannot. */
static size_t carry_out(struct client *c, const struct foxglove_request *r,
                        struct complaint *first)
{
    struct complaint why;
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
    struct complaint why = {""};
    int err = foxglove_request_parse(data, size, binary, &request, &why);
    size_t wrong = err ? 1 : carry_out(c, &request, &why);

    c->server->counts.rejected += wrong;
    if (wrong)
        client_status(c, REPLY_ERROR, why.text);
    if (!err)
        foxglove_request_clear(&request);
}

bool client_take(void *client, const void *data, size_t size, bool binary)
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

enum web_next client_next(void *client, struct web_frame *out)
{
    struct client *c = client;

    pthread_mutex_lock(&c->server->lock);
    enum web_next n = next(c, out);
    pthread_mutex_unlock(&c->server->lock);
    return n;
}

void client_done(void *client, const struct web_frame *f, bool sent)
{
    struct foxglove_server *s = ((struct client *)client)->server;

    pthread_mutex_lock(&s->lock);
    s->counts.sent += sent && f->owner && f->binary;
    pthread_mutex_unlock(&s->lock);
    blob_release(f->owner);
}

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

bool client_refuse(void *server, const struct web_request *r, struct web_reply *out)
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

void *client_open(void *server)
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

void client_close(void *client)
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
