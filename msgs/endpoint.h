/* SPDX-License-Identifier: MIT */
/* msgs/endpoint.h -- where the sockets of a node stand: RUN_DIR/NODE.TOPIC.ipc, a '/' in
 * the topic written as '-', NODE.TOPIC.all for those who must have everything
 * (msgs/reliable.h), and RUN_DIR/NODE.lock, which a live node holds. */
#ifndef ANLOS_MSGS_ENDPOINT_H
#define ANLOS_MSGS_ENDPOINT_H

#include <stdbool.h>

#include "dsp/error.h"

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

#endif
