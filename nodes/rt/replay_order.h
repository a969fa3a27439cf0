/* nodes/rt/replay_order.h -- in a replay, sound and what the vehicle said of itself come
 * over different sockets, and in an order by chance.  This puts them into that of their
 * publish stamps: sound waits until the vehicle's motion of after it is there, which in
 * the recording was so every 20 ms, and the walls of after it while there are any.  So a
 * bag gives the same lists at every pace.  Time is an argument. */
#ifndef ANLOS_NODES_RT_REPLAY_ORDER_H
#define ANLOS_NODES_RT_REPLAY_ORDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/bus.h"

#define REPLAY_ORDER_MAX     256         /* of each kind; of more the oldest goes on */
#define REPLAY_ORDER_WAIT_NS 300000000LL /* for motion that may never come */
#define REPLAY_ORDER_WALL_NS 300000000LL /* of the recording; walls come every 0.1 s */

struct replay_line { /* messages that wait, the oldest first: a ring */
    struct bus_message list[REPLAY_ORDER_MAX];
    size_t first, n;
};

struct replay_order { /* all zero: empty */
    struct replay_line sound, vehicle;
    bool moves;        /* the vehicle tells its motion */
    int64_t motion_ns; /* publish stamp of the newest */
    bool walls;        /* are told */
    int64_t walls_ns;  /* publish stamp of the newest */
    int64_t came_ns;   /* when a message came last, by the machine's clock */
    int64_t left_ns;   /* when who takes them turned to other work; 0: never yet */
};

/* Does the message have to go through here?  Those of sound and of the vehicle, when they
 * are replayed. */
bool replay_order_takes(const struct bus_message *m);

/* Takes over the message. */
void replay_order_put(struct replay_order *o, struct bus_message *m, int64_t now_ns);

/* The next one whose turn it is; *due_ns: when to ask again if nothing comes (INT64_MAX:
 * never).  false: none. */
bool replay_order_take(struct replay_order *o, struct bus_message *out, int64_t now_ns,
                       int64_t *due_ns);

/* Whoever is at work on a message does not wait for the next: that time does not count.
 */
void replay_order_leave(struct replay_order *o, int64_t now_ns);
void replay_order_return(struct replay_order *o, int64_t now_ns);
void replay_order_clear(struct replay_order *o);

#endif
