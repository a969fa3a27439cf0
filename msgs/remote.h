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

struct remote;

/* Reads RUN_DIR/hosts, and the keys of this host when hosts_use_keys.  0, -EINVAL (what
 * is in the files), -ENOENT (no keys), -EACCES (keys that others can read), -ENOMEM,
 * other negative errno. */
int remote_create(struct remote **out, const char *run_dir, struct error *why);
const struct hosts *remote_hosts(const struct remote *r);

/* For the log; called from other threads. */
void remote_on_event(struct remote *r, void (*call)(void *ctx, const char *text),
                     void *ctx);

/* Connections that were refused because they have no permitted key. */
uint64_t remote_refused(const struct remote *r);

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

/* How a topic is heard from other machines: one ZeroMQ SUB socket, connected to each of
 * its publishers there.
 *
 * ZeroMQ connects again by itself after an error of the network, but never again after
 * one of the protocol: a program that had a publisher's port for a moment, or one message
 * over the bound, would end a subscription for good.  So the connections are watched, and
 * what it has given up is connected anew. */
struct remote_subscription;

/* *out NULL: no publisher is on another machine.  *fd (-1) is readable when
 * remote_subscription_receive is to be called, until it returns NULL; call it once before
 * the first wait.  0 or a negative errno. */
int remote_subscription_open(struct remote_subscription **out, int *fd,
                             const struct remote *r, const struct topic *t);

/* The next message, of nn_allocmsg; NULL: none waits. */
void *remote_subscription_receive(struct remote_subscription *e, size_t *size);

/* Sees to the connections; call it every REMOTE_SUBSCRIPTION_TEND_MS.  How many there
 * are. */
#define REMOTE_SUBSCRIPTION_TEND_MS 1000
size_t remote_subscription_tend(struct remote_subscription *e);
void remote_subscription_close(struct remote_subscription *e);

/* After all its sockets.  What is still queued has REMOTE_LINGER_MS to go out. */
#define REMOTE_LINGER_MS 300
void remote_destroy(struct remote *r);

/* Of any socket of ZeroMQ (msgs/reliable.h). */

/* How many are subscribed to an XPUB socket that is verbose of both: those before, and
 * who has come and gone since. */
size_t remote_read_peers(void *socket, size_t before);

/* The next message of a SUB socket, of nn_allocmsg; NULL: none waits. */
void *remote_take_message(void *socket, size_t *size);

#endif
