/* SPDX-License-Identifier: MIT */
/* msgs/remote.h -- the sockets of the bus that go to other machines, ZeroMQ over TCP.
 *
 * nanomsg, which carries the bus within a machine, does not do for a network: its PUB
 * queues nothing, so whatever is sent while a link is slower than the sender is lost, and
 * a peer whose machine lost its power leaves a connection that never ends.  Here each
 * connection has a queue of the topic's depth (what is over it is dropped, and counted
 * where it is missed), the kernel looks whether the other end is alive, and a connection
 * without an answer is given up after REMOTE_PATIENCE_MS and made anew.  What leaves the
 * machine is encrypted, and goes only between hosts that have each other's keys. */
#ifndef ANLOS_MSGS_REMOTE_H
#define ANLOS_MSGS_REMOTE_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/authenticator.h"
#include "msgs/hosts.h"
#include "msgs/topics.h"

#define REMOTE_PATIENCE_MS 7000
#define REMOTE_URL_SIZE    64

struct remote;

/* Reads RUN_DIR/hosts, and the keys of this host when hosts_use_keys.  0, -EINVAL (what
 * is in the files), -ENOENT (no keys), -EACCES (keys that others can read), -ENOMEM,
 * other negative errno. */
int remote_create(struct remote **out, const char *run_dir, struct error *why);
const struct hosts *remote_hosts(const struct remote *r);
void *remote_context(const struct remote *r); /* NULL: nothing is reached by TCP */
struct authenticator *remote_authenticator(const struct remote *r); /* NULL: no keys */

/* For the log; called from other threads. */
void remote_on_event(struct remote *r, void (*call)(void *ctx, const char *text),
                     void *ctx);

/* Connections that were refused because they have no permitted key. */
uint64_t remote_refused(const struct remote *r);

/* tcp://ADDRESS:PORT of a node's topic. */
void remote_url(char url[REMOTE_URL_SIZE], const struct host *h, const char *node,
                const struct topic *t);

/* What all sockets have in common.  incoming: bytes of a message that comes in; a larger
 * one ends the connection before there is memory for it.  0 or a negative errno. */
int remote_set_options(void *socket, const struct topic *t, size_t incoming);

/* How many are subscribed to an XPUB socket that is verbose of both: those before, and
 * who has come and gone since. */
size_t remote_read_peers(void *socket, size_t before);

/* The next message of a SUB socket, of nn_allocmsg; NULL: none waits. */
void *remote_take_message(void *socket, size_t *size);

/* The publishing end of one topic towards other machines. */
struct remote_publisher;

/* Binds the node's topic to the address of this host; *out NULL: it has none, or r is
 * NULL.  0, -EADDRINUSE, -EADDRNOTAVAIL (no address of this machine), other negative
 * errno. */
int remote_bind(struct remote_publisher **out, const struct remote *r, const char *node,
                const struct topic *t, struct error *why);

/* A copy goes into the queue of each connection; never waits, but when the keys have
 * changed: then all connections are ended, and may come back. */
void remote_send(struct remote_publisher *o, const void *message, size_t size);

/* Who is subscribed now. */
size_t remote_count_peers(struct remote_publisher *o);

void remote_close(struct remote_publisher *o);

/* After all its sockets.  What is still queued has REMOTE_LINGER_MS to go out. */
#define REMOTE_LINGER_MS 300
void remote_destroy(struct remote *r);

#endif
