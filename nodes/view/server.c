#include "nodes/view/server.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/foxglove/server.h"
#include "nodes/view/guard.h"
#include "nodes/view/live.h"
#include "nodes/view/page.h"
#include "nodes/web/web.h"

#define WRITE_TIME_MS  30000 /* a browser on a loaded machine may take seconds */
#define SILENCE_TIME_S 10

struct server {
    struct server_config cfg;
    struct web *web;
    struct live *live;
    struct foxglove_server *foxglove;
};

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

static int create_all(struct server *s, struct complaint *why)
{
    const struct web_config web = {.address = s->cfg.address,
                                   .port = s->cfg.port,
                                   .write_ms = WRITE_TIME_MS,
                                   .silence_s = SILENCE_TIME_S,
                                   .log = s->cfg.log,
                                   .log_ctx = s->cfg.log_ctx,
                                   .page = serve,
                                   .page_ctx = s};
    const struct live_config live = {.view = s->cfg.view,
                                     .address = s->cfg.address,
                                     .seek = s->cfg.seek,
                                     .seek_ctx = s->cfg.seek_ctx};
    struct foxglove_config foxglove;
    int err = web_create(&s->web, &web, why);

    if (err)
        return err;
    foxglove_config_default(&foxglove, s->cfg.now_ns);
    err = live_create(&s->live, s->web, &live);
    if (!err)
        err = foxglove_server_create(&s->foxglove, s->web, &foxglove);
    return err ? complain(why, err, "the web server: %s", strerror(-err))
               : web_start(s->web, why);
}

int server_create(struct server **out, const struct server_config *cfg,
                  struct complaint *why)
{
    struct server *s = calloc(1, sizeof *s);

    if (!s)
        return complain(why, -ENOMEM, "not enough memory for the web server");
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
    if (s->live)
        live_stop(s->live);
    web_destroy(s->web);
    foxglove_server_destroy(s->foxglove);
    live_destroy(s->live);
    free(s);
}
