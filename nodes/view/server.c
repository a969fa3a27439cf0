/* SPDX-License-Identifier: MIT */
#include "nodes/view/server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "nodes/foxglove/server.h"
#include "nodes/web/web.h"

#define SCHEME "http://"

/* The name or address in "name:port", "1.2.3.4:port", "[::1]:port".  false: too long, or
 * what follows is no port. */
static bool split(const char *host, char *out, size_t size)
{
    bool bracket = *host == '[';
    const char *start = host + bracket, *end = strpbrk(start, bracket ? "]" : ":");
    size_t n = end ? (size_t)(end - start) : strlen(start);

    if (n >= size || (bracket && !end))
        return false;
    memcpy(out, start, n);
    out[n] = '\0';
    if (!end)
        return n > 0;
    end += bracket;
    return n > 0 &&
           (!*end || (*end == ':' && strspn(end + 1, "0123456789") == strlen(end + 1)));
}

bool guard_host(const char *host, const char *address)
{
    unsigned char binary[sizeof(struct in6_addr)];
    char name[256];

    if (!host || !split(host, name, sizeof name))
        return false;
    if (*host == '[')
        return inet_pton(AF_INET6, name, binary) == 1;
    return !strcasecmp(name, "localhost") || !strcasecmp(name, address) ||
           inet_pton(AF_INET, name, binary) == 1;
}

bool guard_origin(const char *origin, const char *host)
{
    const size_t n = sizeof SCHEME - 1;

    return !origin ||
           (host && !strncasecmp(origin, SCHEME, n) && !strcasecmp(origin + n, host));
}

#define MOST_SLICES 100000000

static int read_mark(struct request *out, const json_t *o)
{
    const json_t *mark = json_object_get(o, "mark"), *name = json_object_get(o, "name");
    const char *text = json_string_value(name);
    bool fits = !name ? json_object_size(o) == 1
                      : json_object_size(o) == 2 && text && *text &&
                            json_string_length(name) == strlen(text);

    if (!json_is_number(mark) || !fits)
        return -EINVAL;
    *out = (struct request){.kind = REQUEST_MARK, .mark_s = json_number_value(mark)};
    snprintf(out->name, sizeof out->name, "%s", text ? text : "");
    return isfinite(out->mark_s) ? 0 : -EINVAL;
}

static int read(struct request *out, const json_t *o)
{
    const json_t *slice = json_object_get(o, "slice"), *seek = json_object_get(o, "seek");

    if (json_object_get(o, "mark"))
        return read_mark(out, o);
    if (!json_is_object(o) || json_object_size(o) != 1)
        return -EINVAL;
    if (json_is_integer(slice)) {
        json_int_t k = json_integer_value(slice);
        *out = (struct request){.kind = REQUEST_SLICE, .slice = (size_t)k};
        return k >= 0 && k < MOST_SLICES ? 0 : -EINVAL;
    }
    if (json_is_true(json_object_get(o, "save"))) {
        *out = (struct request){.kind = REQUEST_SAVE};
        return 0;
    }
    *out = (struct request){.kind = REQUEST_SEEK, .seek_s = json_number_value(seek)};
    return json_is_number(seek) && isfinite(out->seek_s) ? 0 : -EINVAL;
}

int request_parse(struct request *out, const void *data, size_t size)
{
    if (size > REQUEST_MAX_SIZE)
        return -EMSGSIZE;
    json_t *o = json_loadb(data, size, JSON_REJECT_DUPLICATES, NULL);
    int err = o ? read(out, o) : -EINVAL;

    json_decref(o);
    return err;
}

#define WRITE_TIME_MS  30000 /* a browser on a loaded machine may take seconds */
#define SILENCE_TIME_S 10
#define LIVE_MAX_PAGES 12

struct server {
    struct server_config cfg;
    struct web *web;
    size_t pages; /* the web server's thread's */
    struct foxglove_server *foxglove;
};

/* The WebSocket of the page, at "/live": frames of the board out, requests in.  A page
 * that is slow skips frames and keeps nobody waiting. */

struct page {
    struct server *server;
    struct board_reader reader;
};

static bool refuse_page(void *ctx, const struct web_request *r, struct web_reply *out)
{
    const struct server *s = ctx;

    out->status = s->pages >= LIVE_MAX_PAGES ? "503 Service Unavailable"
                                             : "403 Forbidden";
    return s->pages >= LIVE_MAX_PAGES || !guard_host(r->host, s->cfg.address) ||
           !guard_origin(r->origin, r->host);
}

static void *open_page(void *ctx)
{
    struct server *s = ctx;
    struct page *p = s->pages < LIVE_MAX_PAGES ? calloc(1, sizeof *p) : NULL;

    if (!p)
        return NULL;
    p->server = s;
    s->pages++;
    view_pages(s->cfg.view, 1);
    return p;
}

static bool take_request(void *client, const void *data, size_t size, bool binary)
{
    struct page *p = client;
    const struct server_config *cfg = &p->server->cfg;
    struct request request;

    if (!data || binary || request_parse(&request, data, size))
        return false;
    if (request.kind == REQUEST_SEEK && cfg->seek) {
        cfg->seek(cfg->bag_ctx, request.seek_s);
    } else if (request.kind == REQUEST_MARK && cfg->mark) {
        cfg->mark(cfg->bag_ctx, request.mark_s, request.name[0] ? request.name : NULL);
    } else if (request.kind == REQUEST_SAVE && cfg->save) {
        cfg->save(cfg->save_ctx);
    } else if (request.kind == REQUEST_SLICE) {
        struct frame *f = view_slice(cfg->view, request.slice);
        if (f)
            board_hand(view_board(cfg->view), &p->reader, f);
    }
    return true;
}

static enum web_next next_frame(void *client, struct web_frame *out)
{
    struct page *p = client;
    struct frame *f = board_next(view_board(p->server->cfg.view), &p->reader);

    *out = (struct web_frame){.owner = f};
    if (!f)
        return WEB_NOTHING;
    out->body = frame_data(f, &out->body_size, &out->binary);
    return WEB_FRAME;
}

static void drop_frame(void *client, const struct web_frame *f, bool sent)
{
    (void)client;
    (void)sent;
    frame_drop(f->owner);
}

static void close_page(void *client)
{
    struct page *p = client;
    struct server *s = p->server;

    board_close(view_board(s->cfg.view), &p->reader);
    free(p);
    s->pages--;
    view_pages(s->cfg.view, -1);
}

static void wake(void *ctx)
{
    web_wake(((struct server *)ctx)->web);
}

/* The files of the page. */

static const struct page_file *find_file(const char *path)
{
    for (const struct page_file *f = page_files; f->path; f++)
        if (!strcmp(f->path, path))
            return f;
    return NULL;
}

static struct web_reply refusal(const char *status, const char *headers, const char *text)
{
    return (struct web_reply){.status = status,
                              .type = "text/plain; charset=utf-8",
                              .headers = headers,
                              .data = text,
                              .size = strlen(text)};
}

static void serve(void *ctx, const struct web_request *r, struct web_reply *out)
{
    const struct server *s = ctx;
    bool get = !strcmp(r->method, "GET");
    const struct page_file *f = find_file(r->path);

    if (!guard_host(r->host, s->cfg.address))
        *out = refusal("403 Forbidden", NULL,
                       "This host name is not the server's: use its IP address.\n");
    else if (!get && strcmp(r->method, "HEAD"))
        *out = refusal("405 Method Not Allowed", "Allow: GET, HEAD\r\n",
                       "Pages can only be read.\n");
    else if (!f)
        *out = refusal("404 Not Found", NULL, "There is no such page.\n");
    else
        *out = (struct web_reply){
            .status = "200 OK",
            .type = f->type,
            .headers =
                "Cache-Control: no-cache\r\nX-Content-Type-Options: nosniff\r\n"
                "Referrer-Policy: no-referrer\r\n"
                "Cross-Origin-Resource-Policy: same-origin\r\n"
                "Content-Security-Policy: default-src 'self'; frame-ancestors 'none'; "
                "base-uri 'none'; form-action 'none'\r\n",
            .data = f->data,
            .size = f->size,
            .head_only = !get};
}

static int create_all(struct server *s, struct error *why)
{
    const struct web_config web = {.address = s->cfg.address,
                                   .port = s->cfg.port,
                                   .write_ms = WRITE_TIME_MS,
                                   .silence_s = SILENCE_TIME_S,
                                   .log = s->cfg.log,
                                   .log_ctx = s->cfg.log_ctx,
                                   .page = serve,
                                   .page_ctx = s};
    const struct web_endpoint live = {.path = "/live",
                                      .max_message = REQUEST_MAX_SIZE,
                                      .ctx = s,
                                      .refuse = refuse_page,
                                      .open = open_page,
                                      .take = take_request,
                                      .next = next_frame,
                                      .done = drop_frame,
                                      .close = close_page};
    struct foxglove_config foxglove;
    int err = web_create(&s->web, &web, why);

    if (err)
        return err;
    web_serve(s->web, &live);
    board_watch(view_board(s->cfg.view), wake, s);
    foxglove_config_default(&foxglove, s->cfg.now_ns);
    err = foxglove_server_create(&s->foxglove, s->web, &foxglove);
    return err ? error_say(why, err, "the web server: %s", strerror(-err))
               : web_start(s->web, why);
}

int server_create(struct server **out, const struct server_config *cfg, struct error *why)
{
    struct server *s = calloc(1, sizeof *s);

    if (!s)
        return error_say(why, -ENOMEM, "not enough memory for the web server");
    s->cfg = *cfg;
    int err = create_all(s, why);
    if (err)
        server_destroy(s);
    else
        *out = s;
    return err;
}

const char *server_url(const struct server *s)
{
    return web_url(s->web);
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
    board_watch(view_board(s->cfg.view), NULL, NULL); /* it wakes the server no more */
    web_destroy(s->web);
    foxglove_server_destroy(s->foxglove);
    free(s);
}
