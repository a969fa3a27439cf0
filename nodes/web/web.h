/* SPDX-License-Identifier: MIT */
/* nodes/web/web.h -- a web server on one thread: pages, and WebSockets on paths of their
 * own, by libwebsockets.  Whoever can connect is a stranger, so what he sends costs
 * little before it is accepted: of a request 8 kB at most and 10 s, of a message as much
 * as its path allows, whatever length a frame announces, and all that has not been
 * accepted together under 1 MB.  A connection too many takes the place of the oldest that
 * has not come to its request.  Replies go out in pieces, each when the one before has
 * gone: a slow client keeps nobody waiting, and one that takes nothing for a while is
 * given up. */
#ifndef ANLOS_NODES_WEB_WEB_H
#define ANLOS_NODES_WEB_WEB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

#define WEB_URL_SIZE      96
#define WEB_HEAD_SIZE     16
#define WEB_MAX_ENDPOINTS 4
#define WEB_MAX_CLIENTS   48 /* connections of all kinds */
#define WEB_LOG_MS        2000

struct web;

/* Header fields, NULL where the request has none. */
struct web_request {
    const char *method, *path, *host, *origin, *subprotocols;
};

/* All borrowed for as long as the server lives. */
struct web_reply {
    const char *status;  /* "404 Not Found" */
    const char *type;    /* of the content */
    const char *headers; /* further ones, each with its line end */
    const void *data;    /* [size] */
    size_t size;
    bool head_only; /* the data is described and not sent */
};

struct web_config {
    const char *address; /* an IP address; kept by the caller */
    unsigned port;       /* 0: any that is free */
    int write_ms;        /* a client that takes nothing for so long is given up */
    int silence_s;       /* then a WebSocket is pinged; given up after six times that */
    /* Of each connection that did not end as it should, whose end it was and why; NULL:
     * nobody is told.  On the server's thread, a line in WEB_LOG_MS at most. */
    void (*log)(void *ctx, const char *text);
    void *log_ctx;
    void (*page)(void *ctx, const struct web_request *r, struct web_reply *out);
    void *page_ctx; /* page == NULL: there are no pages */
};

/* What goes out next: a message of a head and a body. */
struct web_frame {
    uint8_t head[WEB_HEAD_SIZE];
    size_t head_size, body_size;
    const void *body; /* borrowed until the endpoint's done */
    void *owner;      /* the endpoint's own */
    bool binary;
};

enum web_next { WEB_NOTHING, WEB_FRAME, WEB_GOODBYE };

/* What the WebSockets of a path do.  All of it is called on the server's thread and must
 * not wait. */
struct web_endpoint {
    const char *path;
    const char *const *subprotocols; /* ends with NULL; NULL: none is offered */
    size_t max_message;              /* bytes; an announced frame beyond ends it */
    void *ctx;
    /* true: no connection, but this reply. */
    bool (*refuse)(void *ctx, const struct web_request *r, struct web_reply *out);
    /* The client of a new connection.  NULL: try again later. */
    void *(*open)(void *ctx);
    /* A whole message, not ended by a zero; data NULL: its parts grew beyond max_message.
     * false: hang up. */
    bool (*take)(void *client, const void *data, size_t size, bool binary);
    /* What is to be sent next; asked after every web_wake. */
    enum web_next (*next)(void *client, struct web_frame *out);
    /* The frame of next has gone, or (not sent) never will. */
    void (*done)(void *client, const struct web_frame *f, bool sent);
    void (*close)(void *client);
};

/* Listens, but answers nobody before web_start.  0, -EADDRINUSE, -EACCES, -EADDRNOTAVAIL,
 * -EINVAL (no address), -ENOMEM; the error says what to do. */
int web_create(struct web **out, const struct web_config *cfg, struct error *why);

/* Before web_start, WEB_MAX_ENDPOINTS times at most.  The endpoint is copied. */
void web_serve(struct web *w, const struct web_endpoint *e);
int web_start(struct web *w, struct error *why); /* 0, -ENOMEM, -EAGAIN */

const char *web_url(const struct web *w); /* "http://127.0.0.1:8765/" */
unsigned web_port(const struct web *w);

/* There may be something to send.  Any thread; also before web_start. */
void web_wake(struct web *w);

/* Hangs up on every client: it takes milliseconds, whatever they do.  NULL is fine. */
void web_destroy(struct web *w);

#endif
