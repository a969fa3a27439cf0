/* SPDX-License-Identifier: MIT */
/* msgs/reliable.h -- how who must have everything (a recorder) hears the publishers of
 * its machine: by a ZeroMQ socket that each topic has beside nanomsg's,
 * "ipc://RUN_DIR/NODE.TOPIC.all".
 *
 * nanomsg's PUB drops, without a word, what the kernel does not take at once: a reader
 * that gets no processor for a moment loses what is beyond net.core.wmem_max, of pings
 * little more than one.  Nor does it tell when a subscriber has joined.  Here each
 * subscriber says so, and what it has not read yet waits in the publisher's process, up
 * to RELIABLE_BYTES over all its topics; what is beyond is dropped, and is a gap at the
 * other end.  Nobody waits for a slow one, but a process that ends: RELIABLE_LINGER_MS.
 */
#ifndef ANLOS_MSGS_RELIABLE_H
#define ANLOS_MSGS_RELIABLE_H

#include <stddef.h>

#include "dsp/error.h"

#define RELIABLE_BYTES     ((size_t)64 << 20) /* 10 s of a full array's pings */
#define RELIABLE_LINGER_MS 2000

struct reliable;

/* What the sockets of a bus share.  0, -ENOMEM, other negative errno. */
int reliable_create(struct reliable **out, struct error *why);

/* After all its sockets. */
void reliable_destroy(struct reliable *r);

struct reliable_publisher;

/* 0, -ENOMEM, other negative errno. */
int reliable_bind(struct reliable_publisher **out, struct reliable *r, const char *url,
                  struct error *why);

/* A copy for all who are subscribed; never waits. */
void reliable_send(struct reliable_publisher *o, const void *message, size_t size);

/* Who is subscribed now, and hears what is sent next. */
size_t reliable_count_peers(struct reliable_publisher *o);
void reliable_close(struct reliable_publisher *o);

struct reliable_subscription;

/* Connected to nobody.  *fd is readable when reliable_subscription_receive is to be
 * called, until it returns NULL, and so it is after each other call.  most: bytes of a
 * message; a larger one ends the connection.  0, -ENOMEM, other negative errno. */
int reliable_subscription_open(struct reliable_subscription **out, int *fd,
                               struct reliable *r, size_t most);

/* Goes on by itself when that publisher is gone and comes back.  0, negative errno. */
int reliable_subscription_connect(struct reliable_subscription *s, const char *url);

/* The next message, of nn_allocmsg; NULL: none waits. */
void *reliable_subscription_receive(struct reliable_subscription *s, size_t *size);
void reliable_subscription_close(struct reliable_subscription *s);

#endif
