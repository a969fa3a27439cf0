/* SPDX-License-Identifier: MIT */
/* msgs/endpoint.h -- where the sockets of a node stand: RUN_DIR/NODE.TOPIC.ipc, a '/' in
 * the topic written as '-', NODE.TOPIC.all for those who must have everything
 * (msgs/reliable.h), and RUN_DIR/NODE.lock, which a live node holds; and how it is heard
 * of that one has appeared. */
#ifndef ANLOS_MSGS_ENDPOINT_H
#define ANLOS_MSGS_ENDPOINT_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "msgs/topics.h"

#define ENDPOINT_SCHEME    "ipc://"
#define ENDPOINT_PATH_SIZE 108 /* of sockaddr_un, with the zero */
#define ENDPOINT_URL_SIZE  (sizeof ENDPOINT_SCHEME - 1 + ENDPOINT_PATH_SIZE)

/* Writes "ipc://RUN_DIR/NODE.TOPIC.ipc".  0 or -ENAMETOOLONG. */
int endpoint_url(char url[ENDPOINT_URL_SIZE], const char *run_dir, const char *node,
                 const char *topic, struct error *why);

/* That of the other socket, from this one's: "ipc://RUN_DIR/NODE.TOPIC.all". */
void endpoint_url_of_all(char url[ENDPOINT_URL_SIZE], const char *of);

/* The path in a URL. */
const char *endpoint_path(const char *url);

/* Makes the folder and its parents when missing, for this user only. */
int endpoint_make_folder(const char *run_dir, struct error *why);

/* Takes the lock of a node's name; the kernel lets go of it when the process ends,
 * however it ends.  The file stays: it says which process it was, and whether that lived
 * in a replay (nodes/rt/rundir.h).  A descriptor to close, or -EADDRINUSE (a live node
 * holds it), other negative errno. */
int endpoint_lock(const char *run_dir, const char *node, bool replay, struct error *why);

/* How who must not miss a node's first message (a recorder) meets it: he is told which
 * sockets appear in the run folder, and connects at once and not at the next of nanomsg's
 * tries; and a node that starts knows that he is there, and waits. */

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
