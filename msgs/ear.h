/* msgs/ear.h -- how one topic is heard: a nanomsg SUB socket that is connected to each of
 * its publishers, and the account of what came. */
#ifndef ANLOS_MSGS_EAR_H
#define ANLOS_MSGS_EAR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/envelope.h"
#include "msgs/topics.h"

#define EAR_MAX_PUBLISHERS 16

struct ear_source { /* one publisher */
    bool known;
    int64_t epoch_ns;
    uint64_t next; /* sequence expected */
};

struct ear {
    const struct topic *topic;
    size_t slot;    /* in the mailbox; the caller's */
    int socket, fd; /* fd: readable while messages wait; the socket's own */
    struct ear_source sources[EAR_MAX_PUBLISHERS];
    uint64_t messages, bytes, gaps;
};

/* Publishers may come later, go and come back.  ear_close it after success.
 * 0, -ENAMETOOLONG, -E2BIG (more publishers than there is room for), other negative
 * errno. */
int ear_open(struct ear *ear, const struct topic *t, const char *run_dir);

/* Which publisher of the topic it is; NULL: none of them. */
struct ear_source *ear_find_source(struct ear *ear, const char *node);

/* A message of that source has arrived: counts it, and what is missing before it. */
void ear_count(struct ear *ear, struct ear_source *source, const struct envelope *e);
void ear_close(struct ear *ear);

#endif
