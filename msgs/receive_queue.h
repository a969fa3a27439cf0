/* SPDX-License-Identifier: MIT */
/* msgs/receive_queue.h -- received messages waiting to be read: a bounded queue for each
 * topic with its policy, taken in the order of arrival over all of them.  Any thread may
 * put and take. */
#ifndef ANLOS_MSGS_RECEIVE_QUEUE_H
#define ANLOS_MSGS_RECEIVE_QUEUE_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/bus.h"

struct receive_queue;

/* 0, -ENOMEM, other negative errno (no descriptor left). */
int receive_queue_create(struct receive_queue **out);

/* Adds a queue of the topic's depth and policy; *slot names it.  0, -ENOMEM. */
int receive_queue_add(struct receive_queue *m, const struct topic *t, size_t *slot);

/* For who must have everything: from now on a queue is as long as it has to be, whatever
 * its topic's depth and policy, while all that waits has no more than so many bytes of
 * payload.  What does not fit then is dropped, and counted; a message by itself always
 * fits.  Before anything is put. */
void receive_queue_keep_all(struct receive_queue *m, size_t bytes);

/* Takes the message over.  Never fails and never waits: in a full queue the oldest goes,
 * and is counted unless the policy is TOPIC_LATEST; then the new one takes a turn of its
 * own, behind what waits, but not for ever: no flood of another topic hides a state. What
 * is replayed waits up to 64 MB, whatever depth and policy. */
void receive_queue_put(struct receive_queue *m, size_t slot,
                       const struct bus_message *message);

/* 0, -ETIMEDOUT, -ESHUTDOWN.  timeout_ms < 0: waits for ever. */
int receive_queue_take(struct receive_queue *m, struct bus_message *out, int timeout_ms);

/* Readable while messages wait, and after receive_queue_interrupt. */
int receive_queue_fd(const struct receive_queue *m);
void receive_queue_interrupt(struct receive_queue *m);

/* Ends an interrupt: what waits can be taken again. */
void receive_queue_resume(struct receive_queue *m);

/* Bytes of payload that wait, over all queues. */
size_t receive_queue_waiting_bytes(struct receive_queue *m);

void receive_queue_count(struct receive_queue *m, size_t slot, uint64_t *dropped,
                         size_t *queued);

/* Frees what still waits. */
void receive_queue_destroy(struct receive_queue *m);

#endif
