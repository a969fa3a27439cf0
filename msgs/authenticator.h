/* SPDX-License-Identifier: MIT */
/* msgs/authenticator.h -- who of other hosts may connect: CurveZMQ (RFC 26) on every
 * socket that goes by TCP, and the ZAP handler (RFC 27) of a ZeroMQ context, which lets
 * in the keys of the file peers alone.  A thread of its own answers, reads that file anew
 * when it changes, and counts whoever is refused.
 *
 * A key that is taken out of the file, or changed, ends what is connected with it: what
 * was bound or connected asks authenticator_generation and does so again. */
#ifndef ANLOS_MSGS_AUTHENTICATOR_H
#define ANLOS_MSGS_AUTHENTICATOR_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/keys.h"

#define AUTHENTICATOR_PERIOD_MS 1000  /* so often it looks at the file */
#define AUTHENTICATOR_PAUSE_MS  10000 /* between two lines of the log of one kind */

struct authenticator;

/* Before anything is bound in the context.  Copies the keys.  0 or a negative errno. */
int authenticator_create(struct authenticator **out, void *context,
                         const struct keys *keys);

/* Makes a socket one that only permitted peers are let into, and is told of those that
 * come with no key or a wrong one; before it is bound.  topic: for the log, not copied.
 * 0 or a negative errno. */
int authenticator_guard(struct authenticator *a, void *socket, const char *topic);

/* Makes the next zmq_connect of the socket one to this host alone, in our name.  0,
 * -EACCES (its key is not in the file, or no longer), other negative errno. */
int authenticator_address(struct authenticator *a, void *socket, const char *host);

/* Another number when a key has been taken out, put in, or changed. */
unsigned authenticator_generation(const struct authenticator *a);

/* After the keys have changed the topic's socket could not be bound (err, a negative
 * errno), or later can (0). */
void authenticator_bound_again(struct authenticator *a, const char *topic, int err);

/* A host that was connected to has sent us away (denied), or is not who it should be. */
void authenticator_sent_away(struct authenticator *a, const char *host, bool denied);

/* Connections that were refused here, by one that has no permitted key. */
uint64_t authenticator_refused(const struct authenticator *a);

/* Called for the log, from other threads, at most every AUTHENTICATOR_PAUSE_MS for each
 * kind of event; of sockets that cannot be bound again, each time. */
void authenticator_on_event(struct authenticator *a,
                            void (*call)(void *ctx, const char *text), void *ctx);

/* After the sockets have been closed, before the context ends. */
void authenticator_destroy(struct authenticator *a);

#endif
