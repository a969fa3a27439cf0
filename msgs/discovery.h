/* SPDX-License-Identifier: MIT */
/* msgs/discovery.h -- how who must not miss a node's first message (a recorder) meets it:
 * he is told which sockets appear in the run folder, and connects at once and not at the
 * next of nanomsg's tries; and a node that starts knows that he is there, and waits. */
#ifndef ANLOS_MSGS_DISCOVERY_H
#define ANLOS_MSGS_DISCOVERY_H

#include <stdbool.h>

struct discovery {
    int fd;   /* readable when something has appeared */
    int lock; /* held on RUN_DIR/newcomers.lock, with others who wait too */
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

/* Does somebody wait for them in that folder? */
bool discovery_are_awaited(const char *run_dir);

#endif
