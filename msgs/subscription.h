/* SPDX-License-Identifier: MIT */
/* msgs/subscription.h -- how one topic is heard: a nanomsg SUB socket that is connected
 * to each of its publishers on this machine, another one to those on others
 * (msgs/remote.h), and the account of what came. */
#ifndef ANLOS_MSGS_SUBSCRIPTION_H
#define ANLOS_MSGS_SUBSCRIPTION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/envelope.h"
#include "msgs/reliable.h"
#include "msgs/remote.h"
#include "msgs/topics.h"

#define SUBSCRIPTION_MAX_PUBLISHERS 16
#define SUBSCRIPTION_MAX_PROCESSES  4

/* One publisher: of a name that runs on several machines (hand, launcher) each process is
 * counted for itself. */
struct subscription_source {
    bool here;    /* its socket is in the run folder, or will be */
    bool joined;  /* by the socket for those who must have everything */
    int endpoint; /* nanomsg's, to that socket; -1: not connected to it */
    struct {
        int64_t epoch_ns;
        uint64_t next;  /* sequence expected */
        uint64_t heard; /* the subscription's count of messages then; 0: never */
    } processes[SUBSCRIPTION_MAX_PROCESSES];
};

struct subscription {
    const struct topic *topic;
    size_t slot;    /* in the receive queue; the caller's */
    int socket, fd; /* fd: readable while messages wait; the socket's own */
    struct remote_subscription *remote; /* NULL: no publisher is on another machine */
    int remote_fd;
    size_t remote_peers;
    struct reliable_subscription *reliable; /* NULL: need not have everything */
    int reliable_fd;
    int64_t since_ns; /* publishers that start after it count from their first message */
    struct subscription_source sources[SUBSCRIPTION_MAX_PUBLISHERS];
    uint64_t messages, bytes, gaps;
};

/* Publishers may come later, go and come back.  subscription_close it after success.
 * awaits: nothing may be missed; who is not there yet is connected to by
 * subscription_meet.  0, -ENAMETOOLONG, -E2BIG (more publishers than there is room for),
 * other negative errno. */
int subscription_open(struct subscription *subscription, const struct topic *t,
                      const char *run_dir, const struct remote *remote,
                      struct reliable *reliable, bool awaits);

/* A file of that name has appeared in the run folder: if it is a publisher's socket,
 * connects to it. */
void subscription_meet(struct subscription *subscription, const char *run_dir,
                       const char *name);

/* Which publisher of the topic it is; NULL: none of them. */
struct subscription_source *subscription_find_source(struct subscription *subscription,
                                                     const char *node);

/* A message of that source has arrived: counts it, and what is missing before it. */
void subscription_count(struct subscription *subscription,
                        struct subscription_source *source, const struct envelope *e);

/* Publishers that are connected now, as far as nanomsg and remotes go. */
size_t subscription_peers(const struct subscription *subscription);
void subscription_close(struct subscription *subscription);

#endif
