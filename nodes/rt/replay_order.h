/* SPDX-License-Identifier: MIT */
/* nodes/rt/replay_order.h -- in a replay, what a node hears comes over several sockets,
 * in an order by chance.  This puts it into that of the publish stamps: a message waits
 * until everybody who may still send an earlier one has said that he will not (topic
 * "progress", as the null messages of Chandy and Misra, IEEE Trans. Softw. Eng. SE-5,
 * 1979), and until all that he had sent before is here.  So a bag gives the same at every
 * pace and on every machine.  No clock: who waits in vain is found out by play.
 *
 * When play jumps, another round begins, in which play sends nothing before all have said
 * that they are in it, and they say so before they take anything.  What was sent before
 * is of the round before: what of it waits here, and what of it still comes, is dropped,
 * for it would be given out beside what is played again.
 *
 * Of one stamp, sound comes before the walls that were heard in it. */
#ifndef ANLOS_NODES_RT_REPLAY_ORDER_H
#define ANLOS_NODES_RT_REPLAY_ORDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/bus.h"
#include "msgs/clock.pb-c.h"

#define REPLAY_ORDER_PACERS 8
#define REPLAY_ORDER_TOPICS 16
#define REPLAY_ORDER_SENT   32

struct replay_sent {
    char node[ENVELOPE_NODE_SIZE];
    const struct topic *topic;
    uint64_t next; /* sequence */
};

struct replay_heard { /* what has come here from a node on a topic */
    char node[ENVELOPE_NODE_SIZE];
    const struct topic *topic;
    int64_t epoch_ns;     /* of that node */
    uint64_t first, next; /* sequence: of this round, and of what is to come */
};

struct replay_pacer { /* who sends what is heard here */
    char node[ENVELOPE_NODE_SIZE];
    int64_t epoch_ns;
    uint64_t joined; /* round in which it was first heard since */
    bool heard;      /* in this round; then: */
    int64_t first_ns, time_ns;
    struct replay_sent sent[REPLAY_ORDER_SENT]; /* [n_sent] */
    size_t n_sent;
};

struct replay_order { /* all zero: empty, and messages go on as they come */
    const struct topic *topics[REPLAY_ORDER_TOPICS]; /* [n_topics] that are heard */
    size_t n_topics;
    uint64_t round; /* 0: nobody has told of progress yet */
    struct replay_pacer pacers[REPLAY_ORDER_PACERS]; /* [n_pacers] */
    size_t n_pacers;
    struct replay_heard heard[REPLAY_ORDER_SENT]; /* [n_heard] */
    size_t n_heard;
    struct bus_message *waiting; /* [n_waiting] of [n_room], the next first */
    size_t n_waiting, n_room;
    int64_t told_ns; /* of this round, by replay_order_done */
    bool again;      /* play repeats itself: somebody may have begun to listen since */
};

/* Does the topic have an order?  Health, log and what is of play alone have not. */
bool replay_order_has(const struct topic *t);

/* It is heard here. */
void replay_order_expect(struct replay_order *o, const struct topic *t);

/* What a node says, and its epoch; self: the name of this one. */
void replay_order_progress(struct replay_order *o, const char *self, const char *from,
                           int64_t epoch_ns, const Anlos__Progress *p);

/* Takes over a message of a topic that has an order, and drops it where it is of a round
 * before.  0, -ENOMEM: it stays the caller's. */
int replay_order_put(struct replay_order *o, const struct bus_message *m);

/* The next one whose turn it is.  false: none. */
bool replay_order_take(struct replay_order *o, struct bus_message *out);

/* With nothing to take, and what was taken used: has more of the recording been used than
 * was told before, or has play repeated itself?  Then *time_ns is how far. */
bool replay_order_done(struct replay_order *o, int64_t *time_ns);

void replay_order_clear(struct replay_order *o);

#endif
