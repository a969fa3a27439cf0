/* What a client asks for, on one of civetweb's threads. */
#include <errno.h>
#include <string.h>

#include "nodes/foxglove/server_state.h"

#define FRAME_FINAL 0x80
#define FRAME_KIND  0x0f

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

/* With the lock: requests may come in parts, with a kind in the first and an end in the
 * last.  What grows too long is cut, and refused by its length. */
static void take_part(struct client *c, int bits, const char *bytes, size_t size)
{
    int kind = bits & FRAME_KIND;

    if (kind != MG_WEBSOCKET_OPCODE_CONTINUATION) {
        c->n_partial = 0;
        c->partial_binary = kind == MG_WEBSOCKET_OPCODE_BINARY;
        c->partial_open = true;
    }
    if (!c->partial_open)
        return;
    if (size <= sizeof c->partial - c->n_partial) {
        memcpy(c->partial + c->n_partial, bytes, size);
        c->n_partial += size;
    } else {
        c->partial_open = false;
        c->server->counts.rejected++;
        client_status(c, REPLY_ERROR, "a request that is too long");
    }
    if (!c->partial_open || !(bits & FRAME_FINAL))
        return;
    c->partial_open = false;
    answer(c, c->partial, c->n_partial, c->partial_binary);
}

int client_data(struct mg_connection *connection, int bits, char *bytes, size_t size,
                void *data)
{
    struct foxglove_server *s = data;

    switch (bits & FRAME_KIND) {
    case MG_WEBSOCKET_OPCODE_CONNECTION_CLOSE:
        mg_websocket_write(connection, MG_WEBSOCKET_OPCODE_CONNECTION_CLOSE, bytes,
                           size < 2 ? 0 : 2);
        return 0;
    case MG_WEBSOCKET_OPCODE_PING:
        mg_websocket_write(connection, MG_WEBSOCKET_OPCODE_PONG, bytes, size);
        return 1;
    case MG_WEBSOCKET_OPCODE_CONTINUATION:
    case MG_WEBSOCKET_OPCODE_TEXT:
    case MG_WEBSOCKET_OPCODE_BINARY:
        break;
    default:
        return 1;
    }
    pthread_mutex_lock(&s->lock);
    struct client **link = client_find(s, connection);
    if (link && !(*link)->closed)
        take_part(*link, bits, bytes, size);
    pthread_mutex_unlock(&s->lock);
    return link != NULL;
}
