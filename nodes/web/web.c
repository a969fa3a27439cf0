/* SPDX-License-Identifier: MIT */
#include "nodes/web/web.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <libwebsockets.h>

#include "nodes/rt/stop.h"

#define PIECE_SIZE   65536 /* of what goes out at once */
#define HEADERS_SIZE 8192  /* of a request; a browser sends everybody's cookies */
#define RECEIVE_SIZE 4096
#define TEXT_SIZE    512   /* of a header field that is looked at */
#define REQUEST_MS   10000 /* for a client to have sent its request and read the reply */
#define LOOK_MS      100   /* between two looks for clients that do not go on */
#define SPARE_FDS    16
#define MAX_NAMES    8 /* of subprotocols */

struct connection {
    struct web *web;
    struct connection *next, *before;
    struct lws *wsi;
    int64_t since_ms;
    int64_t waits_ms; /* since when something waits to be written; 0: nothing does */
    int64_t heard_ms; /* of a WebSocket: the last sign of life */
    bool killed;
    bool is_over;                       /* its end was agreed on, or has been logged */
    char why[96];                       /* it was given up; empty: it was not */
    char address[INET6_ADDRSTRLEN + 8]; /* with port */
    struct web_reply reply;

    const struct web_endpoint *endpoint; /* NULL: HTTP, or not known yet */
    void *client;                        /* NULL: not open */
    struct web_frame frame;              /* that is being sent */
    bool sends, too_large;
    size_t sent;
    uint8_t *part; /* [n_part] of a message that has not ended */
    size_t n_part;
    bool cut; /* the message is too long, its rest is left out */
};

struct web {
    struct web_config cfg;
    struct web_endpoint endpoints[WEB_MAX_ENDPOINTS];
    size_t n_endpoints, n_connections;
    struct lws_protocols protocols[MAX_NAMES + 2];
    lws_retry_bo_t patience;
    struct lws_vhost *vhost;
    struct connection *newest, *oldest;
    lws_sorted_usec_list_t timer;
    uint8_t piece[LWS_PRE + PIECE_SIZE];

    int listener; /* -1: libwebsockets has it */
    unsigned port;
    char url[WEB_URL_SIZE];
    pthread_t thread;
    bool runs;
    struct lws_context *_Atomic lws;
    atomic_bool woken, stopping;
    int64_t log_ms;    /* of the last line */
    unsigned n_unsaid; /* lines since */
};

static int64_t now_ms(void)
{
    return (int64_t)(lws_now_usecs() / 1000);
}

__attribute__((format(printf, 2, 3))) static void give_up(struct connection *c,
                                                          const char *format, ...)
{
    va_list args;

    if (c->why[0]) /* the first reason is the cause of the others */
        return;
    va_start(args, format);
    vsnprintf(c->why, sizeof c->why, format, args);
    va_end(args);
}

/* Each connection that ends otherwise than it should. */
static void log_end(struct connection *c)
{
    struct web *w = c->web;
    int64_t now = now_ms();
    char text[384];

    if (c->is_over || !w->cfg.log || atomic_load(&w->stopping))
        return;
    c->is_over = true;
    if (!c->why[0] && !c->endpoint)
        return; /* a page that has been read, or a browser that has thought better of it
                 */
    if (!c->why[0])
        snprintf(c->why, sizeof c->why,
                 "it broke off, %.1f s after its last sign of life",
                 1e-3 * (double)(now - c->heard_ms));
    if (w->log_ms && now - w->log_ms < WEB_LOG_MS) {
        w->n_unsaid++;
        return;
    }
    snprintf(text, sizeof text, "the connection of %s%s%s ended after %.1f s: %s",
             c->address, c->endpoint ? " to " : "", c->endpoint ? c->endpoint->path : "",
             1e-3 * (double)(now - c->since_ms), c->why);
    if (w->n_unsaid)
        text_add(text, sizeof text, " ", "(and %u more before)", w->n_unsaid);
    w->n_unsaid = 0;
    w->log_ms = now;
    w->cfg.log(w->cfg.log_ctx, text);
}

/* Of a client that does not go on: there is nothing to be said to it.  Again and again
 * until it is gone, because libwebsockets sets timeouts of its own over this one. */
static void kill_connection(struct connection *c)
{
    lws_set_timeout(c->wsi, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
    c->killed = true;
}

static void want_to_write(struct connection *c)
{
    if (!c->waits_ms)
        c->waits_ms = now_ms();
    lws_callback_on_writable(c->wsi);
}

static void look_after(lws_sorted_usec_list_t *timer)
{
    struct web *w = lws_container_of(timer, struct web, timer);
    int64_t now = now_ms();

    for (struct connection *c = w->newest; c; c = c->next) {
        bool is_late = !c->client && now - c->since_ms > REQUEST_MS;
        bool is_deaf = c->waits_ms && now - c->waits_ms > w->cfg.write_ms;
        if (is_deaf)
            give_up(c, "it took nothing for %.1f s", 1e-3 * (double)(now - c->waits_ms));
        else if (is_late)
            give_up(c, "it did not come to an end within %d s", REQUEST_MS / 1000);
        if (is_late || is_deaf || c->killed)
            kill_connection(c);
    }
    if (w->newest)
        lws_sul_schedule(w->lws, 0, &w->timer, look_after, LOOK_MS * LWS_US_PER_MS);
}

/* Whose connection it is, for the log. */
static void write_address(struct connection *c)
{
    struct sockaddr_storage a;
    socklen_t size = sizeof a;
    const struct sockaddr_in *a4 = (const struct sockaddr_in *)&a;
    const struct sockaddr_in6 *a6 = (const struct sockaddr_in6 *)&a;
    char text[INET6_ADDRSTRLEN] = "somebody";
    unsigned port = 0;

    if (getpeername(lws_get_socket_fd(c->wsi), (struct sockaddr *)&a, &size)) {
        port = 0;
    } else if (a.ss_family == AF_INET) {
        inet_ntop(AF_INET, &a4->sin_addr, text, sizeof text);
        port = ntohs(a4->sin_port);
    } else if (a.ss_family == AF_INET6) {
        inet_ntop(AF_INET6, &a6->sin6_addr, text, sizeof text);
        port = ntohs(a6->sin6_port);
    }
    snprintf(c->address, sizeof c->address, "%s:%u", text, port);
}

static int connection_open(struct web *w, struct lws *wsi)
{
    struct connection *c = calloc(1, sizeof *c);

    if (!c)
        return -ENOMEM;
    *c = (struct connection){
        .web = w, .next = w->newest, .wsi = wsi, .since_ms = now_ms()};
    c->heard_ms = c->since_ms;
    write_address(c);
    if (c->next)
        c->next->before = c;
    else
        w->oldest = c;
    w->newest = c;
    if (!w->n_connections++)
        lws_sul_schedule(w->lws, 0, &w->timer, look_after, LOOK_MS * LWS_US_PER_MS);
    lws_set_opaque_user_data(wsi, c);
    return 0;
}

static void client_close(struct connection *c)
{
    if (!c->client)
        return;
    if (c->sends)
        c->endpoint->done(c->client, &c->frame, false);
    c->sends = false;
    c->endpoint->close(c->client);
    c->client = NULL;
    free(c->part);
    c->part = NULL;
}

static void connection_close(struct connection *c)
{
    struct web *w = c->web;

    log_end(c);
    client_close(c);
    *(c->before ? &c->before->next : &w->newest) = c->next;
    *(c->next ? &c->next->before : &w->oldest) = c->before;
    w->n_connections--;
    lws_set_opaque_user_data(c->wsi, NULL);
    free(c);
}

/* Of the listening socket.  One connection at a time: it is asked again. */
static void accept_one(struct web *w, int listener)
{
    int one = 1, fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);

    if (fd < 0)
        return;
    if (w->n_connections >= WEB_MAX_CLIENTS) {
        struct connection *c = w->oldest;
        while (c && (c->client || c->killed || c->reply.size))
            c = c->before;
        if (c) {
            give_up(c, "others wanted its place before it had made a request");
            kill_connection(c);
        }
    }
    if (w->n_connections >= WEB_MAX_CLIENTS + SPARE_FDS / 2) {
        close(fd);
        return;
    }
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    lws_adopt_socket_vhost(w->vhost, fd); /* which closes it when it fails */
}

static const char *header(struct lws *wsi, enum lws_token_indexes token,
                          char out[TEXT_SIZE])
{
    *out = '\0';
    if (!lws_hdr_total_length(wsi, token)) /* none, or an empty one */
        return lws_hdr_copy_fragment(wsi, out, TEXT_SIZE, token, 0) < 0 ? NULL : out;
    return lws_hdr_copy(wsi, out, TEXT_SIZE, token) < 0 ? "?" : out; /* too long */
}

static const char *method_of(struct lws *wsi)
{
    char *path;
    int size, method = lws_http_get_uri_and_method(wsi, &path, &size);

    return method == LWSHUMETH_GET ? "GET" : method == LWSHUMETH_HEAD ? "HEAD" : "other";
}

struct texts {
    char host[TEXT_SIZE], origin[TEXT_SIZE], subprotocols[TEXT_SIZE];
};

static struct web_request request_of(struct lws *wsi, const char *path, struct texts *t)
{
    return (struct web_request){
        .method = method_of(wsi),
        .path = path,
        .host = header(wsi, WSI_TOKEN_HOST, t->host),
        .origin = header(wsi, WSI_TOKEN_ORIGIN, t->origin),
        .subprotocols = header(wsi, WSI_TOKEN_PROTOCOL, t->subprotocols)};
}

/* 0, -1: it could not be written. */
static int write_head(struct connection *c)
{
    struct web *w = c->web;
    char *text = (char *)w->piece + LWS_PRE;
    const struct web_reply *r = &c->reply;
    int n = snprintf(text, PIECE_SIZE,
                     "HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %zu\r\n"
                     "Connection: close\r\n%s\r\n",
                     r->status, r->type, r->size, r->headers ? r->headers : "");

    return lws_write(c->wsi, (unsigned char *)text, (size_t)n, LWS_WRITE_HTTP_HEADERS) < n
               ? -1
               : 0;
}

static size_t next_piece(size_t all, size_t sent)
{
    return all - sent < PIECE_SIZE ? all - sent : PIECE_SIZE;
}

/* 0: there is more to come; -1: it is over. */
static int write_body(struct connection *c)
{
    struct web *w = c->web;
    size_t n = next_piece(c->reply.size, c->sent);

    c->waits_ms = 0;
    memcpy(w->piece + LWS_PRE, (const uint8_t *)c->reply.data + c->sent, n);
    c->sent += n;
    bool last = c->sent == c->reply.size;
    if (lws_write(c->wsi, w->piece + LWS_PRE, n,
                  last ? LWS_WRITE_HTTP_FINAL : LWS_WRITE_HTTP) < 0 ||
        last)
        return -1;
    want_to_write(c);
    return 0;
}

static int answer_page(struct connection *c, const char *path)
{
    struct web *w = c->web;
    struct texts texts;
    const struct web_request r = request_of(c->wsi, path, &texts);

    c->reply = (struct web_reply){.status = "404 Not Found", .type = "text/plain"};
    if (w->cfg.page)
        w->cfg.page(w->cfg.page_ctx, &r, &c->reply);
    if (write_head(c) || c->reply.head_only || !c->reply.size)
        return -1;
    want_to_write(c);
    return 0;
}

/* Small ones, at once. */
static int refuse(struct connection *c)
{
    if (!write_head(c) && c->reply.size)
        write_body(c);
    return -1;
}

static bool is_path(struct lws *wsi, const char *path)
{
    char asked[TEXT_SIZE];

    return header(wsi, WSI_TOKEN_GET_URI, asked) && !strcmp(asked, path);
}

/* Of a request for another protocol. */
static int upgrade(struct connection *c, const char *to)
{
    struct web *w = c->web;
    struct texts texts;

    c->reply = (struct web_reply){.status = "404 Not Found", .type = "text/plain"};
    for (size_t i = 0; !strcasecmp(to, "websocket") && i < w->n_endpoints; i++)
        if (is_path(c->wsi, w->endpoints[i].path))
            c->endpoint = &w->endpoints[i];
    if (!c->endpoint)
        return refuse(c);
    const struct web_request r = request_of(c->wsi, c->endpoint->path, &texts);
    return c->endpoint->refuse(c->endpoint->ctx, &r, &c->reply) ? refuse(c) : 0;
}

static int hang_up(struct connection *c, enum lws_close_status status)
{
    if (status == LWS_CLOSE_STATUS_GOINGAWAY)
        c->is_over = true;
    else
        give_up(c, "%s",
                status == LWS_CLOSE_STATUS_MESSAGE_TOO_LARGE ? "its message is too large"
                : status == LWS_CLOSE_STATUS_POLICY_VIOLATION
                    ? "what it sent is no request"
                    : "there is no memory or no place for it");
    lws_close_reason(c->wsi, status, NULL, 0);
    return -1;
}

static int client_open(struct connection *c)
{
    if (!c->endpoint || !(c->client = c->endpoint->open(c->endpoint->ctx)))
        return hang_up(c, LWS_CLOSE_STATUS_NOSTATUS);
    want_to_write(c);
    return 0;
}

/* With the next piece of a message, whole when it is its last one. */
static int take_part(struct connection *c, const uint8_t *data, size_t size)
{
    const struct web_endpoint *e = c->endpoint;
    bool last = lws_is_final_fragment(c->wsi), binary = lws_frame_is_binary(c->wsi);
    bool first = !c->n_part && !c->cut, goes_on = true;

    if (c->cut || size > e->max_message - c->n_part) {
        free(c->part);
        c->part = NULL;
        c->n_part = 0;
        if (!c->cut)
            goes_on = e->take(c->client, NULL, 0, binary);
        c->cut = !last;
        return goes_on ? 0 : hang_up(c, LWS_CLOSE_STATUS_MESSAGE_TOO_LARGE);
    }
    if (!(first && last)) {
        uint8_t *grown = realloc(c->part, c->n_part + size + 1);
        if (!grown)
            return hang_up(c, LWS_CLOSE_STATUS_UNEXPECTED_CONDITION);
        memcpy(grown + c->n_part, data, size);
        c->part = grown;
        c->n_part += size;
        data = grown;
        size = c->n_part;
    }
    if (!last)
        return 0;
    goes_on = e->take(c->client, size ? data : (const uint8_t *)"", size, binary);
    free(c->part);
    c->part = NULL;
    c->n_part = 0;
    return goes_on ? 0 : hang_up(c, LWS_CLOSE_STATUS_POLICY_VIOLATION);
}

static int take(struct connection *c, const uint8_t *data, size_t size)
{
    if (!c->client)
        return -1;
    c->heard_ms = now_ms();
    if (size + lws_remaining_packet_payload(c->wsi) > c->endpoint->max_message)
        return hang_up(c, LWS_CLOSE_STATUS_MESSAGE_TOO_LARGE);
    return take_part(c, data, size);
}

static void copy_piece(const struct web_frame *f, size_t at, uint8_t *out, size_t n)
{
    size_t head = at < f->head_size ? f->head_size - at : 0;

    head = head < n ? head : n;
    memcpy(out, f->head + (at < f->head_size ? at : 0), head);
    if (n > head)
        memcpy(out + head, (const uint8_t *)f->body + (at + head - f->head_size),
               n - head);
}

static int write_piece(struct connection *c)
{
    struct web *w = c->web;
    const struct web_frame *f = &c->frame;
    size_t all = f->head_size + f->body_size, n = next_piece(all, c->sent);
    int flags = lws_write_ws_flags(f->binary ? LWS_WRITE_BINARY : LWS_WRITE_TEXT,
                                   !c->sent, c->sent + n == all);

    copy_piece(f, c->sent, w->piece + LWS_PRE, n);
    if (lws_write(c->wsi, w->piece + LWS_PRE, n, (enum lws_write_protocol)flags) < 0)
        return -1;
    c->sent += n;
    if (c->sent == all) {
        c->sends = false;
        c->endpoint->done(c->client, f, true);
    }
    return 0;
}

/* It can be written again: what was written before has gone. */
static int go_on(struct connection *c)
{
    c->waits_ms = 0;
    if (!c->client)
        return -1;
    if (c->too_large)
        return hang_up(c, LWS_CLOSE_STATUS_MESSAGE_TOO_LARGE);
    if (!c->sends) {
        enum web_next next = c->endpoint->next(c->client, &c->frame);
        c->sends = next == WEB_FRAME;
        c->sent = 0;
        if (next == WEB_GOODBYE)
            return hang_up(c, LWS_CLOSE_STATUS_GOINGAWAY);
        if (next == WEB_NOTHING)
            return 0;
    }
    if (write_piece(c))
        return -1;
    want_to_write(c);
    return 0;
}

/* Of a WebSocket's client: two bytes of why, and its words. */
static void take_goodbye(struct connection *c, const uint8_t *data, size_t size)
{
    unsigned code = size < 2 ? LWS_CLOSE_STATUS_NO_STATUS : 256u * data[0] + data[1];
    char words[48] = "";

    if (code == LWS_CLOSE_STATUS_NORMAL || code == LWS_CLOSE_STATUS_GOINGAWAY ||
        code == LWS_CLOSE_STATUS_NO_STATUS) {
        c->is_over = true;
        return;
    }
    for (size_t i = 2; i < size && i - 2 < sizeof words - 1; i++)
        words[i - 2] = data[i] >= ' ' && data[i] < 0x7f ? (char)data[i] : '?';
    give_up(c, "it hung up, code %u: %s", code, words);
}

static int on_event(struct lws *wsi, enum lws_callback_reasons reason, void *user,
                    void *in, size_t size)
{
    struct web *w = lws_context_user(lws_get_context(wsi));
    struct connection *c = lws_get_opaque_user_data(wsi);

    (void)user;
    if (reason == LWS_CALLBACK_RAW_RX_FILE) {
        accept_one(w, lws_get_socket_fd(wsi));
        return 0;
    }
    if (reason == LWS_CALLBACK_SERVER_NEW_CLIENT_INSTANTIATED)
        return connection_open(w, wsi);
    if (!c)
        return 0;
    switch (reason) {
    case LWS_CALLBACK_HTTP:
        return answer_page(c, in);
    case LWS_CALLBACK_HTTP_WRITEABLE:
        return write_body(c);
    case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
        return upgrade(c, in);
    case LWS_CALLBACK_ESTABLISHED:
        return client_open(c);
    case LWS_CALLBACK_RECEIVE:
        return take(c, in, size);
    case LWS_CALLBACK_SERVER_WRITEABLE:
        return go_on(c);
    case LWS_CALLBACK_RECEIVE_PONG:
        c->heard_ms = now_ms();
        return 0;
    case LWS_CALLBACK_WS_PEER_INITIATED_CLOSE:
        take_goodbye(c, in, size);
        return 0;
    case LWS_CALLBACK_CLOSED:
        log_end(c);
        client_close(c);
        return 0;
    case LWS_CALLBACK_WSI_DESTROY:
        connection_close(c);
        return 0;
    default:
        return 0;
    }
}

/* libwebsockets hands over what has come of a frame, and nothing at all of one that is
 * only announced. */
static void look_at_announcements(struct connection *c)
{
    if (c->too_large || lws_remaining_packet_payload(c->wsi) <= c->endpoint->max_message)
        return;
    c->too_large = true;
    want_to_write(c);
}

static void *run(void *ctx)
{
    struct web *w = ctx;

    while (!atomic_load(&w->stopping) && lws_service(w->lws, 0) >= 0) {
        bool woken = atomic_exchange(&w->woken, false);
        for (struct connection *c = w->newest; c; c = c->next) {
            if (!c->client)
                continue;
            look_at_announcements(c);
            if (woken)
                want_to_write(c);
        }
    }
    return NULL;
}

/* An address of this machine, and its size. */
static int parse_address(const struct web_config *cfg, struct sockaddr_storage *out,
                         socklen_t *size, struct error *why)
{
    struct sockaddr_in *a4 = (struct sockaddr_in *)out;
    struct sockaddr_in6 *a6 = (struct sockaddr_in6 *)out;

    *out = (struct sockaddr_storage){0};
    if (inet_pton(AF_INET, cfg->address, &a4->sin_addr) == 1) {
        a4->sin_family = AF_INET;
        a4->sin_port = htons((uint16_t)cfg->port);
        *size = sizeof *a4;
        return 0;
    }
    if (inet_pton(AF_INET6, cfg->address, &a6->sin6_addr) == 1) {
        a6->sin6_family = AF_INET6;
        a6->sin6_port = htons((uint16_t)cfg->port);
        *size = sizeof *a6;
        return 0;
    }
    return error_say(why, -EINVAL,
                     "address %s: expected an IP address of this machine, such as "
                     "127.0.0.1, or 0.0.0.0 for all",
                     cfg->address);
}

static int open_listener(struct web *w, struct error *why)
{
    struct sockaddr_storage a;
    socklen_t size;
    int one = 1, err = parse_address(&w->cfg, &a, &size, why);

    if (err)
        return err;
    w->listener = socket(a.ss_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (w->listener < 0)
        return error_say(why, -errno, "no socket: %s", strerror(errno));
    setsockopt(w->listener, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(w->listener, (struct sockaddr *)&a, size) || listen(w->listener, 64))
        err = -errno;
    if (err == -EADDRINUSE)
        return error_say(why, err,
                         "port %u of %s is in use, perhaps by another view; choose "
                         "another one with --port or view.port",
                         w->cfg.port, w->cfg.address);
    if (err || getsockname(w->listener, (struct sockaddr *)&a, &size))
        return error_say(why, err ? err : -errno, "port %u of %s: %s", w->cfg.port,
                         w->cfg.address, strerror(err ? -err : errno));
    w->port = ntohs(a.ss_family == AF_INET ? ((struct sockaddr_in *)&a)->sin_port
                                           : ((struct sockaddr_in6 *)&a)->sin6_port);
    snprintf(w->url, sizeof w->url,
             a.ss_family == AF_INET ? "http://%s:%u/" : "http://[%s]:%u/", w->cfg.address,
             w->port);
    return 0;
}

int web_create(struct web **out, const struct web_config *cfg, struct error *why)
{
    struct web *w = calloc(1, sizeof *w);

    if (!w)
        return error_say(why, -ENOMEM, "not enough memory for the web server");
    w->cfg = *cfg;
    w->listener = -1;
    int err = open_listener(w, why);
    if (err)
        web_destroy(w);
    else
        *out = w;
    return err;
}

void web_serve(struct web *w, const struct web_endpoint *e)
{
    if (w->n_endpoints < WEB_MAX_ENDPOINTS)
        w->endpoints[w->n_endpoints++] = *e;
}

/* The first one is for HTTP and for WebSockets that name none. */
static void list_protocols(struct web *w)
{
    size_t n = 0;

    w->protocols[n++] = (struct lws_protocols){
        .name = "http", .callback = on_event, .rx_buffer_size = RECEIVE_SIZE};
    for (size_t i = 0; i < w->n_endpoints; i++)
        for (const char *const *name = w->endpoints[i].subprotocols;
             name && *name && n <= MAX_NAMES; name++)
            w->protocols[n++] = (struct lws_protocols){
                .name = *name, .callback = on_event, .rx_buffer_size = RECEIVE_SIZE};
}

static int adopt_listener(struct web *w)
{
    const lws_sock_file_fd_type fd = {.filefd = w->listener};

    w->vhost = lws_get_vhost_by_name(w->lws, "default");
    if (!w->vhost ||
        !lws_adopt_descriptor_vhost(w->vhost, LWS_ADOPT_RAW_FILE_DESC, fd, "http", NULL))
        return -ENOMEM;
    w->listener = -1;
    return 0;
}

int web_start(struct web *w, struct error *why)
{
    struct lws_context_creation_info info = {
        .port = CONTEXT_PORT_NO_LISTEN_SERVER,
        .protocols = w->protocols,
        .options = LWS_SERVER_OPTION_SKIP_SERVER_CANONICAL_NAME,
        .max_http_header_data = HEADERS_SIZE,
        .fd_limit_per_thread = WEB_MAX_CLIENTS + SPARE_FDS,
        .pt_serv_buf_size = RECEIVE_SIZE,
        .retry_and_idle_policy = &w->patience,
        .gid = (gid_t)-1,
        .uid = (uid_t)-1,
        .user = w};
    sigset_t before;

    w->patience.secs_since_valid_ping = (uint16_t)w->cfg.silence_s;
    w->patience.secs_since_valid_hangup = (uint16_t)(6 * w->cfg.silence_s);
    list_protocols(w);
    lws_set_log_level(0, NULL);
    w->lws = lws_create_context(&info);
    if (!w->lws || adopt_listener(w))
        return error_say(why, -ENOMEM, "not enough memory for the web server");
    stop_block(&before);
    int err = -pthread_create(&w->thread, NULL, run, w);
    stop_unblock(&before);
    w->runs = !err;
    return err ? error_say(why, err, "no thread for the web server: %s", strerror(-err))
               : 0;
}

const char *web_url(const struct web *w)
{
    return w->url;
}

unsigned web_port(const struct web *w)
{
    return w->port;
}

void web_wake(struct web *w)
{
    struct lws_context *lws = w->lws;

    if (lws && !atomic_exchange(&w->woken, true))
        lws_cancel_service(lws);
}

void web_destroy(struct web *w)
{
    if (!w)
        return;
    atomic_store(&w->stopping, true);
    if (w->runs) {
        lws_cancel_service(w->lws);
        pthread_join(w->thread, NULL);
    }
    if (w->lws)
        lws_context_destroy(w->lws);
    if (w->listener >= 0)
        close(w->listener);
    free(w);
}
