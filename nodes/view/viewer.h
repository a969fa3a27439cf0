/* SPDX-License-Identifier: MIT */
/* nodes/view/viewer.h -- the whole of it: what is looked at, a running system or a bag,
 * on a web page.  For the node view and for `anlos view`. */
#ifndef ANLOS_NODES_VIEW_VIEWER_H
#define ANLOS_NODES_VIEW_VIEWER_H

#include "dsp/error.h"
#include "nodes/rt/loop.h"
#include "nodes/view/view.h"

#define VIEWER_ADDRESS "127.0.0.1"
#define VIEWER_PORT    8765

struct viewer;

extern const struct loop viewer_loop; /* of the node, which has subscribed to all */

struct viewer_config {
    struct node *node;   /* not owned; NULL: of `anlos view` */
    const char *address; /* kept by the caller */
    unsigned port;
    const char *bag;     /* NULL: a running system, whose messages viewer_take gets */
    bool may_mark;       /* pages may change the bag's bookmarks */
    const char *run_dir; /* for a person, when there is no bag */
    int64_t now_ns;
    /* Publishes a request to save, which a page may make then, from the thread of
     * viewer_tick; NULL: none may. */
    int (*save)(void *ctx, const ProtobufCMessage *request);
    void *save_ctx;
    /* Of connections that did not end as they should; from another thread.  May be NULL.
     */
    void (*log)(void *ctx, const char *text);
    void *log_ctx;
};

/* 0, errors as server_create and timeline_open. */
int viewer_create(struct viewer **out, const struct viewer_config *cfg,
                  struct error *why);
const char *viewer_url(const struct viewer *v);

/* Without a bag: the messages of view_topic and any others, for Foxglove. */
void viewer_take(struct viewer *v, const struct view_message *m, int64_t now_ns);

/* Shows what is due; returns in how many ms to call it again, at the latest. */
int viewer_tick(struct viewer *v, int64_t now_ns);
void viewer_destroy(struct viewer *v);

#endif
