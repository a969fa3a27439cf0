/* SPDX-License-Identifier: MIT */
/* msgs/discovery.h -- how who must not miss a node's first message (a recorder) meets it:
 * he is told which sockets appear in the run folder, and connects at once and not at the
 * next of nanomsg's tries; and a node that starts knows that he is there, and waits. */
#ifndef ANLOS_MSGS_DISCOVERY_H
#define ANLOS_MSGS_DISCOVERY_H

#include <stdbool.h>
#include <stddef.h>

#include "msgs/topics.h"

struct discovery {
    int fd;   /* readable when something has appeared */
    int lock; /* RUN_DIR/discovery.lock: a byte for each who waits for a topic */
};

/* 0, or a negative errno: inotify(7) has no more to give, or the folder cannot be
 * written.
 */
int discovery_open(struct discovery *n, const char *run_dir);

/* Calls with the name of each file that has appeared since; never waits.  false: the
 * folder is gone, and nothing more will be told of it. */
bool discovery_read(struct discovery *n, void (*call)(void *context, const char *name),
                    void *context);
void discovery_close(struct discovery *n);

/* From now on publishers of the topic that start wait for this one. */
void discovery_await(const struct discovery *n, const struct topic *t);

/* How many wait for publishers of the topic in that folder. */
size_t discovery_awaited(const char *run_dir, const struct topic *t);

#endif
