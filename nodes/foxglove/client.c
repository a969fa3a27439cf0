/* A client from its handshake to its end, and the thread that sends to it. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "nodes/foxglove/channels.h"
#include "nodes/foxglove/origin.h"
#include "nodes/foxglove/server_state.h"

#define GOING_AWAY "\x03\xe9" /* 1001, RFC 6455 7.4.1 */
#define TRY_LATER  "\x03\xf5" /* 1013 */

void client_push(struct client *c, const struct outgoing *o)
{
    struct foxglove_counts *n = &c->server->counts;
    struct subscription *s = o->kind == OUTGOING_MESSAGE ? &c->subscriptions[o->channel]
                                                         : NULL;
    struct complaint told;
    struct channel channel;
    int dropped = queue_push(&c->queue, o);

    pthread_cond_signal(&c->wake);
    if (!dropped)
        return;
    n->dropped += dropped < 0 ? 1 : (uint64_t)dropped;
    if (!s || s->told)
        return;
    s->told = true;
    channel_get(o->channel, &channel);
    complain(
        &told, 0,
        "%s: this connection is too slow for it; what finds no place in the queue is "
        "left out",
        channel.name);
    client_status(c, REPLY_WARNING, told.text);
}

void client_status(struct client *c, enum reply_level level, const char *text)
{
    const struct outgoing o = {.kind = OUTGOING_TEXT, .blob = reply_status(level, text)};

    if (o.blob)
        client_push(c, &o);
}

static bool write_frame(struct client *c, int kind, const void *data, size_t size)
{
    return mg_websocket_write(c->connection, kind, data, size) == (int)size;
}

/* A frame is written in one piece, so the payload is copied behind its head. */
static bool write_message(struct client *c, const struct outgoing *o)
{
    size_t size = REPLY_MESSAGE_HEAD + o->blob->size;
    uint8_t *frame = malloc(size);
    bool sent = false;

    if (frame) {
        reply_message_head(frame, o->subscription, o->t_ns);
        memcpy(frame + REPLY_MESSAGE_HEAD, o->blob->data, o->blob->size);
        sent = write_frame(c, MG_WEBSOCKET_OPCODE_BINARY, frame, size);
    }
    free(frame);
    return sent;
}

static bool write_time(struct client *c, int64_t t_ns)
{
    uint8_t frame[REPLY_TIME_SIZE];

    reply_time(frame, t_ns);
    return write_frame(c, MG_WEBSOCKET_OPCODE_BINARY, frame, sizeof frame);
}

/* With the lock, which it gives back while it writes.  false: nothing can be sent any
 * more. */
static bool send_next(struct client *c)
{
    struct foxglove_server *s = c->server;
    bool say_time = c->time_waits, sent = true;
    int64_t t_ns = s->time_ns;
    struct outgoing o;
    bool found = queue_pop(&c->queue, &o);

    c->time_waits = false;
    pthread_mutex_unlock(&s->lock);
    if (say_time)
        sent = write_time(c, t_ns);
    if (found && sent)
        sent = o.kind == OUTGOING_MESSAGE
                   ? write_message(c, &o)
                   : write_frame(c, MG_WEBSOCKET_OPCODE_TEXT, o.blob->data, o.blob->size);
    if (found)
        blob_release(o.blob);
    pthread_mutex_lock(&s->lock);
    if (found && sent && o.kind == OUTGOING_MESSAGE)
        s->counts.sent++;
    return sent;
}

static void *send_all(void *data)
{
    struct client *c = data;
    struct foxglove_server *s = c->server;

    pthread_mutex_lock(&s->lock);
    while (!c->closed && !c->goodbye) {
        if (!c->queue.first && !c->time_waits)
            pthread_cond_wait(&c->wake, &s->lock);
        else if (!send_next(c))
            c->closed = true;
    }
    bool goodbye = c->goodbye && !c->closed;
    c->closed = true;
    queue_clear(&c->queue);
    pthread_mutex_unlock(&s->lock);
    if (goodbye)
        write_frame(c, MG_WEBSOCKET_OPCODE_CONNECTION_CLOSE, GOING_AWAY, 2);
    else
        mg_close_connection(c->connection); /* only marks it: its thread ends it */
    return NULL;
}

/* Before the handshake mg_send_http_error leaves the head of the response out. */
static void refuse(const struct mg_connection *connection, const char *status,
                   const char *text)
{
    mg_printf((struct mg_connection *)connection,
              "HTTP/1.1 %s\r\nContent-Type: text/plain\r\nContent-Length: %zu\r\n"
              "Connection: close\r\n\r\n%s\n",
              status, strlen(text) + 1, text);
}

/* What civetweb says it has accepted may be of the connection before. */
static bool speaks_foxglove(const struct mg_connection *connection)
{
    static const char *const known[] = FOXGLOVE_SUBPROTOCOLS;
    const struct mg_request_info *info = mg_get_request_info(connection);

    for (int h = 0; h < info->num_headers; h++) {
        const char *at = info->http_headers[h].value;
        if (strcasecmp(info->http_headers[h].name, "Sec-WebSocket-Protocol") != 0)
            continue;
        while (at += strspn(at, ", \t"), *at) {
            size_t n = strcspn(at, ", \t");
            for (size_t k = 0; k < sizeof known / sizeof *known; k++)
                if (n == strlen(known[k]) && !strncmp(at, known[k], n))
                    return true;
            at += n;
        }
    }
    return false;
}

int client_connect(const struct mg_connection *connection, void *data)
{
    struct foxglove_server *s = data;
    const char *origin = mg_get_header(connection, "Origin");
    const char *host = mg_get_header(connection, "Host");
    bool foreign = !origin_is_allowed(origin, host);
    bool mute = !speaks_foxglove(connection);

    pthread_mutex_lock(&s->lock);
    bool full = s->stopping || s->counts.clients >= s->cfg.max_clients;
    s->counts.refused += foreign || mute || full;
    pthread_mutex_unlock(&s->lock);
    if (foreign)
        refuse(connection, "403 Forbidden", "a page of another site may not connect");
    else if (mute)
        refuse(connection, "400 Bad Request",
               "the subprotocol has to be foxglove.sdk.v1 or foxglove.websocket.v1");
    else if (full)
        refuse(connection, "503 Service Unavailable", "too many clients");
    return foreign || mute || full;
}

static void client_free(struct client *c)
{
    if (!c)
        return;
    queue_clear(&c->queue);
    pthread_cond_destroy(&c->wake);
    free(c->subscriptions);
    free(c);
}

static struct client *client_create(struct foxglove_server *s,
                                    struct mg_connection *connection)
{
    struct client *c = calloc(1, sizeof *c);

    if (!c)
        return NULL;
    c->server = s;
    c->connection = connection;
    c->queue.max_bytes = s->cfg.queue_bytes;
    c->queue.max_messages = s->cfg.queue_messages;
    pthread_cond_init(&c->wake, NULL);
    c->subscriptions = calloc(s->n_channels, sizeof *c->subscriptions);
    if (c->subscriptions)
        return c;
    client_free(c);
    return NULL;
}

/* With the lock.  Errors of pthread_create, negative. */
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
    int err = -pthread_create(&c->thread, NULL, send_all, c);
    if (err)
        return err;
    c->next = s->clients;
    s->clients = c;
    s->counts.clients++;
    return 0;
}

void client_ready(struct mg_connection *connection, void *data)
{
    struct foxglove_server *s = data;
    struct client *c = client_create(s, connection);
    bool started = false;

    pthread_mutex_lock(&s->lock);
    if (c && !s->stopping && s->counts.clients < s->cfg.max_clients)
        started = !client_start(c);
    s->counts.refused += !started;
    pthread_mutex_unlock(&s->lock);
    if (started)
        return;
    client_free(c);
    mg_websocket_write(connection, MG_WEBSOCKET_OPCODE_CONNECTION_CLOSE, TRY_LATER, 2);
}

struct client **client_find(struct foxglove_server *s,
                            const struct mg_connection *connection)
{
    struct client **link = &s->clients;

    while (*link && (*link)->connection != connection)
        link = &(*link)->next;
    return *link ? link : NULL;
}

void client_close(const struct mg_connection *connection, void *data)
{
    struct foxglove_server *s = data;

    pthread_mutex_lock(&s->lock);
    struct client **link = client_find(s, connection), *c = link ? *link : NULL;
    if (c) {
        *link = c->next;
        c->closed = true;
        pthread_cond_signal(&c->wake);
    }
    pthread_mutex_unlock(&s->lock);
    if (!c)
        return;
    pthread_join(c->thread, NULL);
    client_free(c);
    pthread_mutex_lock(&s->lock);
    s->counts.clients--;
    pthread_cond_broadcast(&s->parted);
    pthread_mutex_unlock(&s->lock);
}
