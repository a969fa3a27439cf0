/* nodes/view/live.h -- the WebSocket of the page, at "/live": frames of the board out,
 * requests in.  A page that is slow skips frames and keeps nobody waiting. */
#ifndef ANLOS_NODES_VIEW_LIVE_H
#define ANLOS_NODES_VIEW_LIVE_H

#include "nodes/view/view.h"
#include "nodes/web/web.h"

#define LIVE_MAX_PAGES 12

struct live;

struct live_config {
    struct view *view;
    const char *address;                     /* outlives it; for guard_host */
    void (*seek)(void *ctx, double seconds); /* NULL: there is no bag */
    void *seek_ctx;
};

/* Before web_start.  0, -ENOMEM. */
int live_create(struct live **out, struct web *web, const struct live_config *cfg);

/* Before web_destroy: it wakes the server no more. */
void live_stop(struct live *l);

/* After web_destroy.  NULL is fine. */
void live_destroy(struct live *l);

#endif
