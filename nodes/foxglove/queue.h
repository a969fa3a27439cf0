/* SPDX-License-Identifier: MIT */
/* nodes/foxglove/queue.h -- what waits to be sent to a client, bounded in bytes and
 * messages: of a full one the oldest message of the same channel goes, then the oldest of
 * any.  Not thread-safe. */
#ifndef ANLOS_NODES_FOXGLOVE_QUEUE_H
#define ANLOS_NODES_FOXGLOVE_QUEUE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/envelope.h"
#include "msgs/topics.h"

/* Bytes that several owners hold: what goes to many clients is there once. */

struct blob {
    atomic_size_t owners;
    size_t size;
    uint8_t *data; /* [size] */
};

/* Takes over data, which free() frees, also when it fails.  One owner.  NULL: no memory,
 * or no data. */
struct blob *blob_create(uint8_t *data, size_t size);
struct blob *blob_copy(const void *data, size_t size);

/* Another owner. */
struct blob *blob_hold(struct blob *b);

/* An owner less; the last one frees it.  NULL is fine. */
void blob_release(struct blob *b);

#define QUEUE_MAX_TEXTS 64 /* that may wait besides the messages */

enum outgoing_kind { OUTGOING_TEXT, OUTGOING_MESSAGE };

struct outgoing {
    enum outgoing_kind kind;
    struct blob *blob; /* held by who has the outgoing */
    size_t channel;    /* of a message, as the rest */
    uint32_t subscription;
    int64_t t_ns;
};

struct queue {
    size_t max_bytes, max_messages; /* of the messages that wait */
    size_t bytes, messages, texts;
    struct queue_entry *first, *last;
};

/* Takes over the blob.  A message that is larger than max_bytes waits alone.  How many
 * were dropped for it, of which a text may be the new one itself; -ENOMEM: the new one is
 * released. */
int queue_push(struct queue *q, const struct outgoing *o);

/* The oldest.  false: there is none. */
bool queue_pop(struct queue *q, struct outgoing *out);

/* Drops the oldest message; its channel.  false: there is none. */
bool queue_drop(struct queue *q, size_t *channel);

/* Drops what waits of a channel; not counted as lost. */
void queue_forget(struct queue *q, size_t channel);
void queue_clear(struct queue *q);

/* Messages that wait to be converted.  Each topic waits as it does on the bus: of state
 * the newest, of events as many as its depth.  Not thread-safe. */

#define INBOX_MAX_BYTES                                                                  \
    ((size_t)64 << 20) /* of one topic; a larger message waits alone */

struct arrival {
    const struct topic *topic;
    char node[ENVELOPE_NODE_SIZE];
    int64_t capture_ns, publish_ns;
    struct blob *payload; /* held by who has the arrival */
    uint64_t client;      /* for this one only, which has subscribed late; 0: for all */
    size_t channel;       /* that it subscribed to */
};

struct inbox { /* begins zeroed */
    struct inbox_entry *first;
};

/* Takes over the payload.  How many messages were skipped for it; -ENOMEM: this one is
 * released. */
int inbox_push(struct inbox *b, const struct arrival *a);

/* The oldest.  false: there is none. */
bool inbox_pop(struct inbox *b, struct arrival *out);
void inbox_clear(struct inbox *b);

#endif
