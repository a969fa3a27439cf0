#include "nodes/view/live.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "nodes/view/guard.h"
#include "nodes/view/request.h"

struct live {
    struct live_config cfg;
    struct web *web;
    size_t pages; /* the web server's thread's */
};

struct page {
    struct live *live;
    struct board_reader reader;
};

static bool refuse_page(void *ctx, const struct web_request *r, struct web_reply *out)
{
    const struct live *l = ctx;

    out->status = l->pages >= LIVE_MAX_PAGES ? "503 Service Unavailable"
                                             : "403 Forbidden";
    return l->pages >= LIVE_MAX_PAGES || !guard_host(r->host, l->cfg.address) ||
           !guard_origin(r->origin, r->host);
}

static void *open_page(void *ctx)
{
    struct live *l = ctx;
    struct page *p = l->pages < LIVE_MAX_PAGES ? calloc(1, sizeof *p) : NULL;

    if (!p)
        return NULL;
    p->live = l;
    l->pages++;
    view_pages(l->cfg.view, 1);
    return p;
}

static bool take_request(void *client, const void *data, size_t size, bool binary)
{
    struct page *p = client;
    const struct live_config *cfg = &p->live->cfg;
    struct request request;

    if (!data || binary || request_parse(&request, data, size))
        return false;
    if (request.kind == REQUEST_SEEK && cfg->seek) {
        cfg->seek(cfg->seek_ctx, request.seek_s);
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
    struct frame *f = board_next(view_board(p->live->cfg.view), &p->reader);

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
    struct live *l = p->live;

    board_close(view_board(l->cfg.view), &p->reader);
    free(p);
    l->pages--;
    view_pages(l->cfg.view, -1);
}

static void wake(void *ctx)
{
    struct live *l = ctx;

    web_wake(l->web);
}

int live_create(struct live **out, struct web *web, const struct live_config *cfg)
{
    struct live *l = calloc(1, sizeof *l);
    const struct web_endpoint endpoint = {.path = "/live",
                                          .max_message = REQUEST_MAX_SIZE,
                                          .ctx = l,
                                          .refuse = refuse_page,
                                          .open = open_page,
                                          .take = take_request,
                                          .next = next_frame,
                                          .done = drop_frame,
                                          .close = close_page};

    if (!l)
        return -ENOMEM;
    l->cfg = *cfg;
    l->web = web;
    web_serve(web, &endpoint);
    board_watch(view_board(cfg->view), wake, l);
    *out = l;
    return 0;
}

void live_stop(struct live *l)
{
    board_watch(view_board(l->cfg.view), NULL, NULL);
}

void live_destroy(struct live *l)
{
    free(l);
}
