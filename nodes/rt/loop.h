/* SPDX-License-Identifier: MIT */
/* nodes/rt/loop.h -- a node as a table: which topic goes to which handler, what is due
 * when, what it counts, how it ends; and the loop that goes by it.  Nothing is made
 * because nothing came: what is periodic and what waits for a deadline is a timer; what
 * follows from what came is one that runs after each message, too; what is better made of
 * all that has come is one that runs last.  In a replay messages come in the order of
 * their publish stamps, as from node_next; timers are of the machine there too, so what a
 * replay is to repeat hangs on none. */
#ifndef ANLOS_NODES_RT_LOOP_H
#define ANLOS_NODES_RT_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#include "nodes/rt/node.h"

#define LOOP_NEVER INT64_MAX
#define LOOP_DONE  1 /* from a handler or a timer: all is done, the loop ends */

struct loop_input {
    const struct topic *(*topic)(void);
    /* 0, LOOP_DONE, or a negative errno that ends the node. */
    int (*take)(void *self, const struct node_message *in);
    bool (*wanted)(const void *self); /* NULL: always; asked once, at the start */
};

enum loop_when {
    LOOP_DUE,
    LOOP_EACH, /* also at the start and after each message */
    LOOP_LAST, /* when it is due, but not before all messages that are there were taken */
};

struct loop_timer {
    /* node_machine_ns at which it is due, looked at in each turn; 0 and what is past: at
     * once; LOOP_NEVER. */
    int64_t (*due_ns)(const void *self);
    int (*run)(void *self); /* as take */
    enum loop_when when;
};

struct loop { /* tables end with a row of zeros; NULL: none */
    const struct loop_input *inputs;
    const struct loop_timer *timers;
    const char *waits_for;     /* its state until it says another one; or NULL */
    void (*start)(void *self); /* once all is subscribed; or NULL */
    /* Whatever else the node has subscribed to; or NULL. */
    int (*rest)(void *self, const struct node_message *in);
    /* What is readable there is waited for, too, and taken by what runs after each
     * message: that runs after each wait then, of 100 ms at most.  NULL: messages alone.
     */
    int (*fd)(const void *self);
    size_t (*counts)(void *self, struct device_count *out); /* of each health; or NULL */
    /* After the loop, with what it ended with: what the node ends with (node_finish); or
     * NULL. */
    int (*end)(void *self, int err);
    void (*close)(void *self); /* NULL is safe */
};

/* Subscribes to what is wanted, and goes on until one of them returns other than 0, or a
 * signal asks to stop.  In each turn the timers run whose turn it is, in their order, and
 * one message is taken; without one, those that run last.  0 after LOOP_DONE, -ESHUTDOWN,
 * or what they returned. */
int loop_run(struct node *n, const struct loop *l, void *self);

/* The rest of a node's main, once all that it needs is open, or could not be opened: err
 * and why, which is logged, are of that.  Runs, ends and closes self, which is NULL where
 * it was not made, and the node.  Returns the process's exit code, as node_finish. */
int loop_main(struct node *n, const struct loop *l, void *self, int err,
              const struct error *why);

#endif
