#include "nodes/view/live.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "nodes/rt/stop.h"
#include "nodes/view/guard.h"
#include "nodes/view/request.h"

#define REFUSE 1 /* of a connect handler */
#define KEEP   1 /* of a data handler */
#define CLOSE  0

struct live {
    struct live_config cfg;
    atomic_int pages;
};

struct page {
    struct live *live;
    struct mg_connection *conn;
    struct board_reader reader;
    pthread_t sender;
    bool sends;
};

static int connect_page(const struct mg_connection *conn, void *ctx)
{
    struct live *l = ctx;
    const char *host = mg_get_header(conn, "Host");

    if (!guard_host(host, l->cfg.address) ||
        !guard_origin(mg_get_header(conn, "Origin"), host))
        return REFUSE;
    if (atomic_fetch_add(&l->pages, 1) >= LIVE_MAX_PAGES) {
        atomic_fetch_sub(&l->pages, 1);
        return REFUSE;
    }
    struct page *p = calloc(1, sizeof *p);
    if (!p) {
        atomic_fetch_sub(&l->pages, 1);
        return REFUSE;
    }
    p->live = l;
    mg_set_user_connection_data(conn, p);
    view_pages(l->cfg.view, 1);
    return 0;
}

static void *send_frames(void *ctx)
{
    struct page *p = ctx;
    struct board *board = view_board(p->live->cfg.view);
    struct frame *f;

    while ((f = board_next(board, &p->reader))) {
        size_t size;
        bool binary;
        const uint8_t *data = frame_data(f, &size, &binary);
        int sent = mg_websocket_write(
            p->conn, binary ? MG_WEBSOCKET_OPCODE_BINARY : MG_WEBSOCKET_OPCODE_TEXT,
            (const char *)data, size);
        frame_drop(f);
        if (sent <= 0)
            break;
    }
    return NULL;
}

static void start_page(struct mg_connection *conn, void *ctx)
{
    struct page *p = mg_get_user_connection_data(conn);
    sigset_t before;

    (void)ctx;
    p->conn = conn;
    stop_block(&before);
    p->sends = !pthread_create(&p->sender, NULL, send_frames, p);
    stop_unblock(&before);
}

static int take_data(struct mg_connection *conn, int bits, char *data, size_t size,
                     void *ctx)
{
    struct live *l = ctx;
    struct page *p = mg_get_user_connection_data(conn);
    struct request request;

    switch (bits & 0xf) {
    case MG_WEBSOCKET_OPCODE_PING:
    case MG_WEBSOCKET_OPCODE_PONG:
        return KEEP;
    case MG_WEBSOCKET_OPCODE_TEXT:
        break;
    default:
        return CLOSE;
    }
    if (!p->sends || request_parse(&request, data, size))
        return CLOSE;
    if (request.kind == REQUEST_SEEK && l->cfg.seek) {
        l->cfg.seek(l->cfg.seek_ctx, request.seek_s);
    } else if (request.kind == REQUEST_SLICE) {
        struct frame *f = view_slice(l->cfg.view, request.slice);
        if (f)
            board_hand(view_board(l->cfg.view), &p->reader, f);
    }
    return KEEP;
}

static void end_page(const struct mg_connection *conn, void *ctx)
{
    struct live *l = ctx;
    struct page *p = mg_get_user_connection_data(conn);

    if (!p)
        return;
    board_close(view_board(l->cfg.view), &p->reader);
    if (p->sends)
        pthread_join(p->sender, NULL);
    mg_set_user_connection_data(conn, NULL);
    free(p);
    view_pages(l->cfg.view, -1);
    atomic_fetch_sub(&l->pages, 1);
}

int live_create(struct live **out, struct mg_context *ctx, const struct live_config *cfg)
{
    struct live *l = calloc(1, sizeof *l);

    if (!l)
        return -ENOMEM;
    l->cfg = *cfg;
    mg_set_websocket_handler(ctx, "/live", connect_page, start_page, take_data, end_page,
                             l);
    *out = l;
    return 0;
}

void live_destroy(struct live *l)
{
    free(l);
}
