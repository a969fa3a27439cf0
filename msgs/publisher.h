/* SPDX-License-Identifier: MIT */
/* msgs/publisher.h -- the publishing end of one topic of one node: a nanomsg PUB socket
 * of its own.  nanomsg filters at the subscriber, so topics that shared a socket would
 * each send everything to everybody, and a large volume on its way would cost the
 * receipts behind it. */
#ifndef ANLOS_MSGS_PUBLISHER_H
#define ANLOS_MSGS_PUBLISHER_H

#include "msgs/bus.h"
#include "msgs/reliable.h"
#include "msgs/remote.h"

struct publisher;

/* The caller holds the node's lock, so a socket file that is there is of a dead process
 * and goes.  remote NULL: nobody on another machine is to hear it.  0, -ENOMEM,
 * -ENAMETOOLONG, other negative errno. */
int publisher_create(struct publisher **out, const struct bus_config *cfg,
                     struct remote *remote, struct reliable *reliable,
                     const struct topic *t, struct error *why);

/* A message with room for size bytes at *payload.  NULL: out of memory. */
void *publisher_allocate(size_t size, void **payload);

/* Puts the envelope on, sends, and takes the message over in any case.  Thread-safe.
 * 0 or a negative errno. */
int publisher_send(struct publisher *o, int64_t capture_ns, int64_t publish_ns,
                   void *message, size_t size);

/* A message with a copy of payload[size].  0, -EMSGSIZE (more than its topic has),
 * -ENOMEM, or as publisher_send. */
int publisher_send_copy(struct publisher *o, int64_t capture_ns, int64_t publish_ns,
                        const void *payload, size_t size);

/* Of what is sent from now on.  Thread-safe. */
void publisher_set_replayed(struct publisher *o, bool replayed);

const struct topic *publisher_topic(const struct publisher *o);
void publisher_count(struct publisher *o, struct bus_count *out);

/* Until those who must have everything (msgs/reliable.h) and are there have joined all of
 * o[n], so that they hear the first message; not for ever. */
void publishers_await_recorders(struct publisher *const *o, size_t n,
                                const char *run_dir);

/* Bytes that the kernel takes for a connection before its reader reads.  nanomsg drops a
 * message while the one before has not gone there whole. */
size_t publisher_room(const struct publisher *o);
void publisher_destroy(struct publisher *o);

/* How fast bytes may follow each other: a leaky bucket.  A PUB socket drops what comes
 * while the message before has not gone into the kernel's buffer yet, and tells nobody;
 * so a publisher keeps to a pace at which a reader that is awake keeps up. */
struct pace {
    double rate_bytes_s;
    double burst_bytes; /* that may be under way when the next message starts */
    double level_bytes; /* under way at stamp_ns; 0 at first */
    int64_t stamp_ns;
};

/* How long after now_ns the next message may start.  A message that is larger than the
 * burst is not held back for its own size, only the one behind it. */
int64_t pace_delay_ns(const struct pace *p, int64_t now_ns);

/* This many bytes started at now_ns. */
void pace_spend(struct pace *p, int64_t now_ns, double bytes);

#endif
