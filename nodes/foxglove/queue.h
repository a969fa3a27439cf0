/* nodes/foxglove/queue.h -- what waits to be sent to a client, bounded in bytes and
 * messages: of a full one the oldest message of the same channel goes, then the oldest of
 * any.  Not thread-safe. */
#ifndef ANLOS_NODES_FOXGLOVE_QUEUE_H
#define ANLOS_NODES_FOXGLOVE_QUEUE_H

#include <stdbool.h>

#include "nodes/foxglove/blob.h"

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

#endif
