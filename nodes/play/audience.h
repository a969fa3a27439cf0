/* nodes/play/audience.h -- the nodes that hear what is played, as their health says: who
 * is there, who is ready and connected, who was started again. */
#ifndef ANLOS_NODES_PLAY_AUDIENCE_H
#define ANLOS_NODES_PLAY_AUDIENCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/envelope.h"
#include "msgs/health.pb-c.h"
#include "msgs/topics.h"

#define AUDIENCE_MAX 16

struct listener {
    char name[ENVELOPE_NODE_SIZE];
    int64_t epoch_ns; /* 0: not heard yet */
    int64_t heard_ns; /* its newest health, by the machine's clock */
    Anlos__Health__State state;
    bool connected; /* to everybody whom it listens to */
};

struct audience {
    struct listener list[AUDIENCE_MAX]; /* [n] */
    size_t n;
    /* Will that node speak on that topic? */
    bool (*speaks)(const void *ctx, const char *node, const struct topic *t);
    const void *ctx;
};

void audience_init(struct audience *a,
                   bool (*speaks)(const void *ctx, const char *node,
                                  const struct topic *t),
                   const void *ctx);

/* A node that is waited for. */
void audience_expect(struct audience *a, const char *name);
bool audience_has(const struct audience *a, const char *name);

/* true: the node was started again, and what it knew is lost. */
bool audience_health(struct audience *a, const char *name, int64_t epoch_ns,
                     const Anlos__Health *health, int64_t now_ns);

/* All there, ready and connected?  Else text[size] says who is waited for. */
bool audience_is_ready(const struct audience *a, char *text, size_t size);

/* Was its health heard after that?  true of one that is not waited for. */
bool audience_heard(const struct audience *a, const char *name, int64_t after_ns);

#endif
