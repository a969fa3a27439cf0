/* SPDX-License-Identifier: MIT */
/* nodes/play/subscribers.h -- the nodes that hear what is played, as their health says:
 * who is there, who is ready and connected, who was started again. */
#ifndef ANLOS_NODES_PLAY_SUBSCRIBERS_H
#define ANLOS_NODES_PLAY_SUBSCRIBERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/clock.pb-c.h"
#include "msgs/envelope.h"
#include "msgs/health.pb-c.h"
#include "msgs/topics.h"

#define SUBSCRIBERS_MAX 16

struct listener {
    char name[ENVELOPE_NODE_SIZE];
    int64_t epoch_ns; /* 0: not heard yet */
    int64_t heard_ns; /* its newest health, by the machine's clock */
    Anlos__Health__State state;
    bool connected; /* to everybody whom it listens to */
    bool paces;     /* it tells of its progress: */
    uint64_t round;
    int64_t used_ns; /* up to that publish stamp it has used everything of the round */
    uint64_t lost;   /* messages */
    bool given_up;   /* it tells nothing any more, and is not waited for */
};

struct subscribers {
    struct listener list[SUBSCRIBERS_MAX]; /* [n] */
    size_t n;
    /* Will that node speak on that topic? */
    bool (*speaks)(const void *ctx, const char *node, const struct topic *t);
    const void *ctx;
};

void subscribers_init(struct subscribers *a,
                      bool (*speaks)(const void *ctx, const char *node,
                                     const struct topic *t),
                      const void *ctx);

/* A node that is waited for. */
void subscribers_expect(struct subscribers *a, const char *name);
bool subscribers_has(const struct subscribers *a, const char *name);

/* true: the node was started again, and what it knew is lost. */
bool subscribers_health(struct subscribers *a, const char *name, int64_t epoch_ns,
                        const Anlos__Health *health, int64_t now_ns);

/* All there, ready and connected?  Else text[size] says who is waited for. */
bool subscribers_is_ready(const struct subscribers *a, char *text, size_t size);

/* How far it is, by its own word.  false: nobody waits for it. */
bool subscribers_progress(struct subscribers *a, const char *name,
                          const Anlos__Progress *p);

/* Who is farthest behind in a round: name and stamp up to which all have used everything,
 * INT64_MIN before the round has begun for all; without anybody to wait for, NULL and
 * INT64_MAX. */
struct listener *subscribers_last(struct subscribers *a, uint64_t round,
                                  int64_t *used_ns);

/* Messages that were lost or dropped on the way to all of them. */
uint64_t subscribers_lost(const struct subscribers *a);

/* Was its health heard after that?  true of one that is not waited for. */
bool subscribers_heard(const struct subscribers *a, const char *name, int64_t after_ns);

#endif
