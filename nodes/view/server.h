/* nodes/view/server.h -- the web server: the page, which is built into the program, and
 * its WebSockets: "/live" for the page (live.h), "/" for Foxglove
 * (nodes/foxglove/server.h).  It serves no files. */
#ifndef ANLOS_NODES_VIEW_SERVER_H
#define ANLOS_NODES_VIEW_SERVER_H

#include "dsp/complaint.h"
#include "nodes/view/view.h"

struct server;

struct server_config {
    struct view *view;
    const char *address; /* an IP address; kept by the caller */
    unsigned port;       /* 0: any that is free */
    int64_t now_ns;
    void (*seek)(void *ctx, double seconds); /* NULL: there is no bag */
    void *seek_ctx;
    /* As of web_config. */
    void (*log)(void *ctx, const char *text);
    void *log_ctx;
};

/* Serves until it is destroyed.  0, -EADDRINUSE, -EACCES, -EADDRNOTAVAIL, -EINVAL (no
 * address), -ENOMEM; the complaint says what to do. */
int server_create(struct server **out, const struct server_config *cfg,
                  struct complaint *why);

/* "http://127.0.0.1:8765/" */
const char *server_url(const struct server *s);

/* A message of the bus, for Foxglove; payload may be NULL. */
struct foxglove_message;
void server_message(struct server *s, const struct foxglove_message *m);
void server_time(struct server *s, int64_t now_ns);

/* Hangs up on every client: it takes milliseconds, whatever they do. */
void server_destroy(struct server *s);

#endif
