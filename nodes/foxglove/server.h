/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/server.h -- what arrives on the bus, offered to Foxglove (and
 * Lichtblick) by its WebSocket protocol on the path "/" of a web server: every topic
 * in its own schema, and under "view/" what a person looks at in Foxglove's schemas
 * (channels.h). https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md, version
 * 1; subprotocols foxglove.sdk.v1 and foxglove.websocket.v1.
 *
 * A client only reads: it can publish nothing, set nothing and call nothing.  One thread
 * converts, and only what somebody subscribes to; each client has a bounded queue, and
 * all together have a bound too, so that a slow one keeps nobody waiting. */
#ifndef ANLOS_NODES_FOXGLOVE_SERVER_H
#define ANLOS_NODES_FOXGLOVE_SERVER_H

#include <stddef.h>
#include <stdint.h>

#include "nodes/foxglove/message.h"
#include "nodes/web/web.h"

struct foxglove_server;

struct foxglove_config {
    const char *name;      /* shown to the user of the client: "anlos" */
    int64_t session_ns;    /* another one than that of any server before it */
    size_t max_clients;    /* connections beyond are refused */
    size_t queue_bytes;    /* that may wait for a client */
    size_t total_bytes;    /* for all of them; of a full one the oldest messages go from
                            * the client that has most */
    size_t queue_messages; /* likewise */
};

/* Clients, queue and names as they should be for one person or a few: 8 clients, 8 MB and
 * 1024 messages each, 16 MB together.  session_ns: the time now. */
void foxglove_config_default(struct foxglove_config *cfg, int64_t now_ns);

struct foxglove_counts {
    size_t clients;    /* connected now */
    size_t waiting;    /* bytes of messages, for all of them, now */
    uint64_t sent;     /* messages, to all clients together */
    uint64_t dropped;  /* from the full queues of slow clients */
    uint64_t skipped;  /* came faster than they could be converted */
    uint64_t failed;   /* could not be converted */
    uint64_t refused;  /* connections: too many, or of a foreign web page */
    uint64_t rejected; /* wishes of clients that could not be carried out */
};

/* Before web_start.  0, -ENOMEM, -EAGAIN (no thread). */
int foxglove_server_create(struct foxglove_server **out, struct web *web,
                           const struct foxglove_config *cfg);

/* Returns at once: the work is done by the server's thread.  A topic's channels are
 * offered from its first message on.  The newest survey, image, detections and states are
 * kept for who subscribes later. */
void foxglove_server_message(struct foxglove_server *s, const struct foxglove_message *m);

/* The time of the system, live or replayed: told to the clients 20 times a second at
 * most, however often this is called. */
void foxglove_server_time(struct foxglove_server *s, int64_t now_ns);

void foxglove_server_counts(struct foxglove_server *s, struct foxglove_counts *out);

/* To be called before web_destroy: says goodbye to every client, waits 0.3 s at most for
 * them to hang up, and takes no new one. */
void foxglove_server_stop(struct foxglove_server *s);

/* After web_destroy.  NULL is fine. */
void foxglove_server_destroy(struct foxglove_server *s);

#endif
