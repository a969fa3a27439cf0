/* SPDX-License-Identifier: MIT */
/* msgs/subscriber.h -- the receiving end of a node: a subscription for each topic, and
 * one thread that checks what comes in, counts gaps and puts it into the receive queue.
 */
#ifndef ANLOS_MSGS_SUBSCRIBER_H
#define ANLOS_MSGS_SUBSCRIBER_H

#include "msgs/bus.h"
#include "msgs/receive_queue.h"
#include "msgs/reliable.h"
#include "msgs/remote.h"

struct subscriber;

/* The receive queue, the remote and reliable must outlive it.  0, -ENOMEM, other negative
 * errno. */
int subscriber_create(struct subscriber **out, const char *run_dir, enum bus_world world,
                      struct remote *remote, struct reliable *reliable,
                      struct receive_queue *receive_queue);

/* Connects to every publisher; a second time does nothing.  0, -ENOMEM, -ENAMETOOLONG,
 * other negative errno. */
int subscriber_subscribe(struct subscriber *in, const struct topic *t);

/* Of publishers that start after now_ns, every message counts that does not arrive, be it
 * before the first that does; so they are connected to as soon as they appear.  For
 * subscriptions to come. */
void subscriber_count_from_start(struct subscriber *in, int64_t now_ns);

size_t subscriber_counts(struct subscriber *in, struct bus_count *out, size_t max);
uint64_t subscriber_refused(struct subscriber *in);
void subscriber_on_refusal(struct subscriber *in,
                           void (*call)(void *ctx, const char *text), void *ctx);

/* Ends the thread first: nothing comes into the receive queue any more. */
void subscriber_destroy(struct subscriber *in);

#endif
