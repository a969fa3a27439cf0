/* msgs/ear.h -- how one topic is heard: a nanomsg SUB socket that is connected to each of
 * its publishers on this machine, another one to those on others (msgs/remote_ear.h), and
 * the account of what came. */
#ifndef ANLOS_MSGS_EAR_H
#define ANLOS_MSGS_EAR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/envelope.h"
#include "msgs/remote_ear.h"
#include "msgs/topics.h"

#define EAR_MAX_PUBLISHERS 16
#define EAR_MAX_PROCESSES  4

/* One publisher: of a name that runs on several machines (hand, launcher) each process is
 * counted for itself. */
struct ear_source {
    bool here;    /* its socket is in the run folder, or will be */
    int endpoint; /* nanomsg's, to that socket; -1: not connected to it */
    struct {
        int64_t epoch_ns;
        uint64_t next;  /* sequence expected */
        uint64_t heard; /* the ear's count of messages then; 0: never */
    } processes[EAR_MAX_PROCESSES];
};

struct ear {
    const struct topic *topic;
    size_t slot;               /* in the receive queue; the caller's */
    int socket, fd;            /* fd: readable while messages wait; the socket's own */
    struct remote_ear *remote; /* NULL: no publisher is on another machine */
    int remote_fd;
    size_t remote_peers;
    int64_t since_ns; /* publishers that start after it count from their first message */
    struct ear_source sources[EAR_MAX_PUBLISHERS];
    uint64_t messages, bytes, gaps;
};

/* Publishers may come later, go and come back.  ear_close it after success.
 * awaits: who is not there yet is connected to by ear_meet.
 * 0, -ENAMETOOLONG, -E2BIG (more publishers than there is room for), other negative
 * errno. */
int ear_open(struct ear *ear, const struct topic *t, const char *run_dir,
             const struct remote *remote, bool awaits);

/* A file of that name has appeared in the run folder: if it is a publisher's socket,
 * connects to it. */
void ear_meet(struct ear *ear, const char *run_dir, const char *name);

/* Which publisher of the topic it is; NULL: none of them. */
struct ear_source *ear_find_source(struct ear *ear, const char *node);

/* A message of that source has arrived: counts it, and what is missing before it. */
void ear_count(struct ear *ear, struct ear_source *source, const struct envelope *e);

/* Publishers that are connected now. */
size_t ear_peers(const struct ear *ear);
void ear_close(struct ear *ear);

#endif
