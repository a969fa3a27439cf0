/* nodes/foxglove/inbox.h -- messages that wait to be converted.  Each topic waits as it
 * does on the bus: of state the newest, of events as many as its depth.  Not thread-safe.
 */
#ifndef ANLOS_NODES_FOXGLOVE_INBOX_H
#define ANLOS_NODES_FOXGLOVE_INBOX_H

#include <stdbool.h>

#include "msgs/envelope.h"
#include "msgs/topics.h"
#include "nodes/foxglove/blob.h"

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
