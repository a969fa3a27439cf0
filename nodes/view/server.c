#include "nodes/view/server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "nodes/foxglove/server.h"
#include "nodes/rt/stop.h"
#include "nodes/view/guard.h"
#include "nodes/view/hang_up.h"
#include "nodes/view/live.h"
#include "nodes/view/page.h"

/* Pages, Foxglove's clients, and a few more so that the page itself can always be had. */
#define THREADS       "28"
#define WRITE_TIME_MS "5000"
#define SILENCE_TIME_MS                                                                  \
    "10000" /* then a WebSocket is pinged; after five of them, closed */

struct server {
    struct server_config cfg;
    struct mg_context *ctx;
    struct live *live;
    struct foxglove_server *foxglove;
    unsigned port;
    char url[SERVER_URL_SIZE];
};

static void answer(struct mg_connection *conn, const char *status, const char *headers,
                   const char *text)
{
    mg_printf(conn,
              "HTTP/1.1 %s\r\nContent-Type: text/plain; charset=utf-8\r\n"
              "Content-Length: %zu\r\nConnection: close\r\n%s\r\n%s",
              status, strlen(text), headers, text);
}

static const struct page_file *find_file(const char *path)
{
    for (const struct page_file *f = page_files; f->path; f++)
        if (!strcmp(f->path, path))
            return f;
    return NULL;
}

static void send_file(struct mg_connection *conn, const struct page_file *f, bool body)
{
    mg_printf(conn,
              "HTTP/1.1 200 OK\r\nContent-Type: %s\r\nContent-Length: %zu\r\n"
              "Cache-Control: no-cache\r\nConnection: close\r\n"
              "X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n"
              "Cross-Origin-Resource-Policy: same-origin\r\n"
              "Content-Security-Policy: default-src 'self'; frame-ancestors 'none'; "
              "base-uri 'none'; form-action 'none'\r\n\r\n",
              f->type, f->size);
    if (body)
        mg_write(conn, f->data, f->size);
}

static int serve(struct mg_connection *conn, void *ctx)
{
    const struct server *s = ctx;
    const struct mg_request_info *r = mg_get_request_info(conn);
    bool get = !strcmp(r->request_method, "GET");

    if (!guard_host(mg_get_header(conn, "Host"), s->cfg.address)) {
        answer(conn, "403 Forbidden", "",
               "This host name is not the server's: use its IP address.\n");
        return 403;
    }
    if (!get && strcmp(r->request_method, "HEAD")) {
        answer(conn, "405 Method Not Allowed", "Allow: GET, HEAD\r\n",
               "Pages can only be read.\n");
        return 405;
    }
    const struct page_file *f = find_file(r->local_uri ? r->local_uri : "");
    if (!f) {
        answer(conn, "404 Not Found", "", "There is no such page.\n");
        return 404;
    }
    send_file(conn, f, get);
    return 200;
}

static int quiet(const struct mg_connection *conn, const char *text)
{
    (void)conn;
    (void)text;
    return 1;
}

/* Could the port be had?  civetweb only says that it could not. */
static int try_port(const struct server_config *cfg, bool v6, struct complaint *why)
{
    struct sockaddr_in a4 = {.sin_family = AF_INET,
                             .sin_port = htons((uint16_t)cfg->port)};
    struct sockaddr_in6 a6 = {.sin6_family = AF_INET6,
                              .sin6_port = htons((uint16_t)cfg->port)};
    int one = 1, err = 0;

    if (inet_pton(v6 ? AF_INET6 : AF_INET, cfg->address,
                  v6 ? (void *)&a6.sin6_addr : (void *)&a4.sin_addr) != 1)
        return complain(why, -EINVAL,
                        "address %s: expected an IP address of this machine, such as "
                        "127.0.0.1, or 0.0.0.0 for all",
                        cfg->address);
    int fd = socket(v6 ? AF_INET6 : AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return complain(why, -errno, "no socket: %s", strerror(errno));
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(fd, v6 ? (struct sockaddr *)&a6 : (struct sockaddr *)&a4,
             v6 ? sizeof a6 : sizeof a4) ||
        listen(fd, 1))
        err = -errno;
    close(fd);
    if (err == -EADDRINUSE)
        return complain(why, err,
                        "port %u of %s is in use, perhaps by another view; choose "
                        "another one with --port or view.port",
                        cfg->port, cfg->address);
    return err ? complain(why, err, "port %u of %s: %s", cfg->port, cfg->address,
                          strerror(-err))
               : 0;
}

static int start(struct server *s, struct complaint *why)
{
    bool v6 = strchr(s->cfg.address, ':') != NULL;
    char listen_on[80];
    const char *options[] = {"listening_ports",
                             listen_on,
                             "num_threads",
                             THREADS,
                             "request_timeout_ms",
                             WRITE_TIME_MS,
                             "websocket_timeout_ms",
                             SILENCE_TIME_MS,
                             "enable_websocket_ping_pong",
                             "yes",
                             "enable_keep_alive",
                             "no",
                             "decode_url",
                             "no",
                             "tcp_nodelay",
                             "1",
                             NULL};
    struct mg_callbacks callbacks = {.log_message = quiet, .log_access = quiet};
    struct mg_init_data init = {
        .callbacks = &callbacks, .user_data = s, .configuration_options = options};
    char text[256] = "";
    struct mg_error_data error = {.text = text, .text_buffer_size = sizeof text};
    struct mg_server_port port;
    sigset_t before;
    int err = try_port(&s->cfg, v6, why);

    if (err)
        return err;
    snprintf(listen_on, sizeof listen_on, v6 ? "[%s]:%u" : "%s:%u", s->cfg.address,
             s->cfg.port);
    stop_block(&before);
    s->ctx = mg_start2(&init, &error);
    stop_unblock(&before);
    if (!s->ctx || mg_get_server_ports(s->ctx, 1, &port) < 1)
        return complain(why, -EADDRINUSE, "no web server at %s: %s", listen_on, text);
    s->port = (unsigned)port.port;
    snprintf(s->url, sizeof s->url, v6 ? "http://[%s]:%u/" : "http://%s:%u/",
             s->cfg.address, s->port);
    return 0;
}

static int add_handlers(struct server *s)
{
    const struct live_config live = {.view = s->cfg.view,
                                     .address = s->cfg.address,
                                     .seek = s->cfg.seek,
                                     .seek_ctx = s->cfg.seek_ctx};
    struct foxglove_config foxglove;
    int err = live_create(&s->live, s->ctx, &live);

    foxglove_config_default(&foxglove, s->cfg.now_ns);
    if (!err)
        err = foxglove_server_create(&s->foxglove, s->ctx, &foxglove);
    if (!err)
        mg_set_request_handler(s->ctx, "**", serve, s);
    return err;
}

int server_create(struct server **out, const struct server_config *cfg,
                  struct complaint *why)
{
    struct server *s = calloc(1, sizeof *s);

    if (!s)
        return complain(why, -ENOMEM, "not enough memory for the web server");
    s->cfg = *cfg;
    mg_init_library(MG_FEATURES_WEBSOCKET);
    int err = start(s, why);
    if (!err && (err = add_handlers(s)))
        complain(why, err, "the web server: %s", strerror(-err));
    if (err)
        server_destroy(s);
    else
        *out = s;
    return err;
}

const char *server_url(const struct server *s)
{
    return s->url;
}

void server_message(struct server *s, const struct foxglove_message *m)
{
    foxglove_server_message(s->foxglove, m);
}

void server_time(struct server *s, int64_t now_ns)
{
    foxglove_server_time(s->foxglove, now_ns);
}

void server_destroy(struct server *s)
{
    if (!s)
        return;
    if (s->foxglove)
        foxglove_server_stop(s->foxglove);
    if (s->ctx) {
        hang_up(s->port);
        hang_up(s->port); /* on whoever was let in meanwhile: nobody is any more */
        mg_stop(s->ctx);
    }
    foxglove_server_destroy(s->foxglove);
    live_destroy(s->live);
    mg_exit_library();
    free(s);
}
