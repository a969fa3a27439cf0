/* nodes/view/live.h -- the WebSocket of the page, at "/live": frames of the board out,
 * requests in.  Each page has a thread that sends; a page that does not read loses its
 * connection when civetweb's time for a write is over, and keeps nobody waiting. */
#ifndef ANLOS_NODES_VIEW_LIVE_H
#define ANLOS_NODES_VIEW_LIVE_H

#include <civetweb.h>

#include "nodes/view/view.h"

#define LIVE_MAX_PAGES 12 /* each takes one of civetweb's threads */

struct live;

struct live_config {
    struct view *view;
    const char *address;                     /* outlives it; for guard_host */
    void (*seek)(void *ctx, double seconds); /* NULL: there is no bag */
    void *seek_ctx;
};

/* Registers itself at ctx, which runs.  0, -ENOMEM. */
int live_create(struct live **out, struct mg_context *ctx, const struct live_config *cfg);

/* After mg_stop.  NULL is fine. */
void live_destroy(struct live *l);

#endif
