/* nodes/foxglove/server_state.h -- the inside of a server: its clients, and the thread
 * that converts.  One lock guards all of it; nobody holds it while he converts or sends.
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

#define FOXGLOVE_SUBPROTOCOLS                                                            \
    {                                                                                    \
        "foxglove.sdk.v1", "foxglove.websocket.v1"                                       \
    }

struct subscription { /* of a client to a channel */
    bool active;
    bool told; /* that it is too slow */
    uint32_t id;
};

struct client {
    struct foxglove_server *server;
    struct client *next;
    struct mg_connection *connection;
    uint64_t serial; /* from 1, of no other client before */
    pthread_t thread;
    pthread_cond_t wake;
    struct queue queue;
    struct subscription *subscriptions;         /* [n_channels] */
    bool time_waits;                            /* the server's time is to be sent */
    bool goodbye;                               /* to be sent as soon as may be */
    bool closed;                                /* nothing more can be sent */
    uint8_t partial[FOXGLOVE_REQUEST_MAX_SIZE]; /* [n_partial] of a request in parts */
    size_t n_partial;
    bool partial_binary, partial_open;
};

struct foxglove_server {
    struct foxglove_config cfg;
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
    struct setting setting; /* of the thread that converts alone */
};

/* With the lock: something for a client to send.  Takes over what it holds. */
void client_push(struct client *c, const struct outgoing *o);
void client_status(struct client *c, enum reply_level level, const char *text);

/* With the lock: the link to the client of a connection.  NULL: there is none. */
struct client **client_find(struct foxglove_server *s,
                            const struct mg_connection *connection);

/* Handlers of civetweb; data is the server. */
int client_connect(const struct mg_connection *connection, void *data);
void client_ready(struct mg_connection *connection, void *data);
int client_data(struct mg_connection *connection, int bits, char *bytes, size_t size,
                void *data);
void client_close(const struct mg_connection *connection, void *data);

/* With the lock: the newest messages of a channel's topics, for a client that has just
 * subscribed to it. */
void press_late(struct foxglove_server *s, const struct client *c, size_t channel);

/* The thread that converts; data is the server. */
void *press_run(void *data);

#endif
