/* msgs/outlet.h -- the publishing end of one topic of one node: a nanomsg PUB socket of
 * its own.  nanomsg filters at the subscriber, so topics that shared a socket would each
 * send everything to everybody, and a large volume on its way would cost the receipts
 * behind it. */
#ifndef ANLOS_MSGS_OUTLET_H
#define ANLOS_MSGS_OUTLET_H

#include "msgs/bus.h"
#include "msgs/remote.h"

struct outlet;

/* The caller holds the node's lock, so a socket file that is there is of a dead process
 * and goes.  remote NULL: nobody on another machine is to hear it.  0, -ENOMEM,
 * -ENAMETOOLONG, other negative errno. */
int outlet_create(struct outlet **out, const struct bus_config *cfg,
                  struct remote *remote, const struct topic *t, struct complaint *why);

/* A message with room for size bytes at *payload.  NULL: out of memory. */
void *outlet_allocate(size_t size, void **payload);

/* Puts the envelope on, sends, and takes the message over in any case.  Thread-safe.
 * 0 or a negative errno. */
int outlet_send(struct outlet *o, int64_t capture_ns, int64_t publish_ns, void *message,
                size_t size);

/* A message with a copy of payload[size].  0, -EMSGSIZE (more than its topic has),
 * -ENOMEM, or as outlet_send. */
int outlet_send_copy(struct outlet *o, int64_t capture_ns, int64_t publish_ns,
                     const void *payload, size_t size);

/* Of what is sent from now on.  Thread-safe. */
void outlet_set_replayed(struct outlet *o, bool replayed);

const struct topic *outlet_topic(const struct outlet *o);
void outlet_count(struct outlet *o, struct bus_count *out);

/* Bytes that the kernel takes for a connection before its reader reads.  nanomsg drops a
 * message while the one before has not gone there whole. */
size_t outlet_room(const struct outlet *o);
void outlet_destroy(struct outlet *o);

#endif
