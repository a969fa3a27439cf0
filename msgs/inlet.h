/* msgs/inlet.h -- the receiving end of a node: an ear for each topic (msgs/ear.h), and
 * one thread that checks what comes in, counts gaps and puts it into the mailbox. */
#ifndef ANLOS_MSGS_INLET_H
#define ANLOS_MSGS_INLET_H

#include "msgs/bus.h"
#include "msgs/mailbox.h"
#include "msgs/remote.h"

struct inlet;

/* The mailbox and the remote must outlive it.  0, -ENOMEM, other negative errno. */
int inlet_create(struct inlet **out, const char *run_dir, enum bus_world world,
                 struct remote *remote, struct mailbox *mailbox);

/* Connects to every publisher; a second time does nothing.  0, -ENOMEM, -ENAMETOOLONG,
 * other negative errno. */
int inlet_subscribe(struct inlet *in, const struct topic *t);

/* Of publishers that start after now_ns, every message counts that does not arrive, be it
 * before the first that does; so they are connected to as soon as they appear.  For
 * subscriptions to come. */
void inlet_count_from_start(struct inlet *in, int64_t now_ns);

size_t inlet_counts(struct inlet *in, struct bus_count *out, size_t max);
uint64_t inlet_refused(struct inlet *in);
void inlet_on_refusal(struct inlet *in, void (*call)(void *ctx, const char *text),
                      void *ctx);

/* Ends the thread first: nothing comes into the mailbox any more. */
void inlet_destroy(struct inlet *in);

#endif
