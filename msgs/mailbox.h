/* msgs/mailbox.h -- received messages waiting to be read: a bounded queue for each topic
 * with its policy, taken in the order of arrival over all of them.  Any thread may put
 * and take. */
#ifndef ANLOS_MSGS_MAILBOX_H
#define ANLOS_MSGS_MAILBOX_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/bus_message.h"

struct mailbox;

/* 0, -ENOMEM, other negative errno (no descriptor left). */
int mailbox_create(struct mailbox **out);

/* Adds a queue of the topic's depth and policy; *slot names it.  0, -ENOMEM. */
int mailbox_add(struct mailbox *m, const struct topic *t, size_t *slot);

/* For who must have everything: from now on a queue is as long as it has to be, whatever
 * its topic's depth and policy, while all that waits has no more than so many bytes of
 * payload.  What does not fit then is dropped, and counted; a message by itself always
 * fits.  Before anything is put. */
void mailbox_keep_all(struct mailbox *m, size_t bytes);

/* Takes the message over.  Never fails and never waits: in a full queue the oldest goes,
 * and is counted unless the policy is TOPIC_LATEST.  What is replayed waits up to 64 MB,
 * whatever depth and policy. */
void mailbox_put(struct mailbox *m, size_t slot, const struct bus_message *message);

/* 0, -ETIMEDOUT, -ESHUTDOWN.  timeout_ms < 0: waits for ever. */
int mailbox_take(struct mailbox *m, struct bus_message *out, int timeout_ms);

/* Readable while messages wait, and after mailbox_interrupt. */
int mailbox_fd(const struct mailbox *m);
void mailbox_interrupt(struct mailbox *m);

/* Ends an interrupt: what waits can be taken again. */
void mailbox_resume(struct mailbox *m);

/* Bytes of payload that wait, over all queues. */
size_t mailbox_waiting_bytes(struct mailbox *m);

void mailbox_count(struct mailbox *m, size_t slot, uint64_t *dropped, size_t *queued);

/* Frees what still waits. */
void mailbox_destroy(struct mailbox *m);

#endif
