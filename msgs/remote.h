/* msgs/remote.h -- the sockets of the bus that go to other machines, ZeroMQ over TCP.
 *
 * nanomsg, which carries the bus within a machine, does not do for a network: its PUB
 * queues nothing, so whatever is sent while a link is slower than the sender is lost, and
 * a peer whose machine lost its power leaves a connection that never ends.  Here each
 * connection has a queue of the topic's depth (what is over it is dropped, and counted
 * where it is missed), the kernel looks whether the other end is alive, and a connection
 * without an answer is given up after REMOTE_PATIENCE_MS and made anew. */
#ifndef ANLOS_MSGS_REMOTE_H
#define ANLOS_MSGS_REMOTE_H

#include <stddef.h>

#include "msgs/complaint.h"
#include "msgs/hosts.h"
#include "msgs/topics.h"

#define REMOTE_PATIENCE_MS 7000
#define REMOTE_URL_SIZE    64

struct remote;

/* Reads RUN_DIR/hosts.  0, -EINVAL (what is in the file), -ENOMEM, other negative errno.
 */
int remote_create(struct remote **out, const char *run_dir, struct complaint *why);
const struct hosts *remote_hosts(const struct remote *r);
void *remote_context(const struct remote *r); /* NULL: nothing is reached by TCP */

/* tcp://ADDRESS:PORT of a node's topic. */
void remote_url(char url[REMOTE_URL_SIZE], const struct host *h, const char *node,
                const struct topic *t);

/* What all sockets have in common.  incoming: bytes of a message that comes in; a larger
 * one ends the connection before there is memory for it.  0 or a negative errno. */
int remote_set_options(void *socket, const struct topic *t, size_t incoming);

/* Binds the node's topic to the address of this host; *socket NULL: it has none, or r is
 * NULL.
 * 0, -EADDRINUSE, -EADDRNOTAVAIL (no address of this machine), other negative errno. */
int remote_bind(void **socket, const struct remote *r, const char *node,
                const struct topic *t, struct complaint *why);

/* A copy goes into the queue of each connection; never waits. */
void remote_send(void *socket, const void *message, size_t size);

/* Keeps *peers, 0 at first, at the number of subscribers of a socket that is bound. */
void remote_count_peers(void *socket, size_t *peers);

void remote_close(void *socket);

/* After all its sockets.  What is still queued has REMOTE_LINGER_MS to go out. */
#define REMOTE_LINGER_MS 300
void remote_destroy(struct remote *r);

#endif
