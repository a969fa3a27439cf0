/* SPDX-License-Identifier: MIT */
/* nodes/view/server.h -- the web server: the page, which is built into the program, and
 * its WebSockets: "/live" for the page, "/" for Foxglove
 * (nodes/foxglove/server.h).  It serves no files. */
#ifndef ANLOS_NODES_VIEW_SERVER_H
#define ANLOS_NODES_VIEW_SERVER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "nodes/view/view.h"

struct server;

struct server_config {
    struct view *view;
    const char *address; /* an IP address; kept by the caller */
    unsigned port;       /* 0: any that is free */
    int64_t now_ns;
    /* Of a bag; NULL: there is none.  name NULL: the bookmark goes. */
    void (*seek)(void *ctx, double seconds);
    void (*mark)(void *ctx, double seconds, const char *name);
    void *bag_ctx;
    void (*save)(void *ctx); /* NULL: pages only read */
    void *save_ctx;
    /* As of web_config. */
    void (*log)(void *ctx, const char *text);
    void *log_ctx;
};

/* Serves until it is destroyed.  0, -EADDRINUSE, -EACCES, -EADDRNOTAVAIL, -EINVAL (no
 * address), -ENOMEM; the error says what to do. */
int server_create(struct server **out, const struct server_config *cfg,
                  struct error *why);

/* "http://127.0.0.1:8765/" */
const char *server_url(const struct server *s);

/* A message of the bus, for Foxglove; payload may be NULL. */
struct foxglove_message;
void server_message(struct server *s, const struct foxglove_message *m);
void server_time(struct server *s, int64_t now_ns);

/* Hangs up on every client: it takes milliseconds, whatever they do. */
void server_destroy(struct server *s);

/* Who may read the pages: a web page of somebody else's, open in the same browser, may
 * not.  It could reach a server on loopback by a name of its own that it lets point
 * there (DNS rebinding): so only addresses, "localhost" and the address that was
 * configured are taken as Host; and it could open a WebSocket across origins, which
 * browsers let pass: so an Origin has to be the page's own. */

/* host: the request's Host header, with or without port; NULL: it has none. */
bool guard_host(const char *host, const char *address);

/* origin: the request's Origin header; NULL: no browser sent it. */
bool guard_origin(const char *origin, const char *host);

/* What a page asks for: a JSON text of one key, {"slice": K}: the slice at depth index K
 * of the newest image; {"seek": S}: of a bag, the state S seconds after its start;
 * {"save": true}: a recorder's last seconds, as a bag; {"mark": S, "name": "TEXT"}: of a
 * bag, a bookmark there, and without a name, that the one there goes. */

#define REQUEST_MAX_SIZE 256

enum request_kind { REQUEST_SLICE, REQUEST_SEEK, REQUEST_SAVE, REQUEST_MARK };

struct request {
    enum request_kind kind;
    size_t slice;
    double seek_s, mark_s;
    char name[REQUEST_MAX_SIZE]; /* of a bookmark; empty: it goes */
};

/* data[size] need not end with a zero.  0, -EINVAL, -EMSGSIZE, -ENOMEM. */
int request_parse(struct request *out, const void *data, size_t size);

/* The files of the web page, built into the program (page.cmake). */

struct page_file {
    const char *path; /* "/style.css"; index.html is "/" too */
    const char *type; /* as of HTTP's Content-Type */
    const uint8_t *data;
    size_t size;
};

/* Ends with path == NULL. */
extern const struct page_file page_files[];

#endif
