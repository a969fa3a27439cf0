/* SPDX-License-Identifier: MIT */
/* msgs/remote_subscription.h -- how a topic is heard from other machines: one ZeroMQ SUB
 * socket, connected to each of its publishers there.
 *
 * ZeroMQ connects again by itself after an error of the network, but never again after
 * one of the protocol: a program that had a publisher's port for a moment, or one message
 * over the bound, would end a subscription for good.  So the connections are watched, and
 * what it has given up is connected anew. */
#ifndef ANLOS_MSGS_REMOTE_SUBSCRIPTION_H
#define ANLOS_MSGS_REMOTE_SUBSCRIPTION_H

#include <stddef.h>

#include "msgs/remote.h"

#define REMOTE_SUBSCRIPTION_TEND_MS 1000

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
size_t remote_subscription_tend(struct remote_subscription *e);
void remote_subscription_close(struct remote_subscription *e);

#endif
