/* nodes/foxglove/server_state.h -- the inside of a server: its clients, and the thread
 * that converts.  One lock guards all of it; nobody holds it while he converts.
 */
#ifndef ANLOS_NODES_FOXGLOVE_SERVER_STATE_H
#define ANLOS_NODES_FOXGLOVE_SERVER_STATE_H

#include <pthread.h>
#include <stdbool.h>

#include "nodes/foxglove/inbox.h"
#include "nodes/foxglove/queue.h"
#include "nodes/foxglove/reply.h"
#include "nodes/foxglove/request.h"
#include "nodes/foxglove/server.h"
#include "nodes/foxglove/setting.h"

struct subscription { /* of a client to a channel */
    bool active;
    bool told; /* that it is too slow */
    uint32_t id;
};

struct client {
    struct foxglove_server *server;
    struct client *next;
    uint64_t serial; /* from 1, of no other client before */
    struct queue queue;
    struct subscription *subscriptions; /* [n_channels] */
    bool time_waits;                    /* the server's time is to be sent */
    bool goodbye;                       /* to be said as soon as may be */
};

struct foxglove_server {
    struct foxglove_config cfg;
    struct web *web;
    size_t n_channels;
    struct blob *info; /* the first thing that a client hears */

    pthread_mutex_t lock;
    pthread_cond_t work;   /* for the thread that converts */
    pthread_cond_t parted; /* a client has gone */
    bool *offered;         /* [n_channels]: something of it has come */
    bool *named;           /* [n_channels]: to be told now */
    struct client *clients;
    uint64_t n_ever; /* clients */
    struct foxglove_counts counts;
    bool stopping;
    int64_t time_ns, time_sent_ms; /* by the system's time; by the machine's */
    struct arrival *newest;        /* [n_topics]; payload NULL: none */
    struct inbox inbox;

    pthread_t press;
    bool presses;           /* the thread that converts has not been ended */
    struct setting setting; /* of the thread that converts alone */
};

/* With the lock: something for a client to send.  Takes over what it holds. */
void client_push(struct client *c, const struct outgoing *o);
void client_status(struct client *c, enum reply_level level, const char *text);

/* Of nodes/web/web.h: the server's endpoint; the context is the server. */
extern const char *const foxglove_subprotocols[]; /* ends with NULL */
bool client_refuse(void *server, const struct web_request *r, struct web_reply *out);
void *client_open(void *server);
bool client_take(void *client, const void *data, size_t size, bool binary);
enum web_next client_next(void *client, struct web_frame *out);
void client_done(void *client, const struct web_frame *f, bool sent);
void client_close(void *client);

/* With the lock: the newest messages of a channel's topics, for a client that has just
 * subscribed to it. */
void press_late(struct foxglove_server *s, const struct client *c, size_t channel);

/* The thread that converts; data is the server. */
void *press_run(void *data);

#endif
