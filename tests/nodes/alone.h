/* SPDX-License-Identifier: MIT */
/* tests/nodes/alone.h -- one node's program by itself: the test is everybody else. */
#ifndef ANLOS_TESTS_NODES_ALONE_H
#define ANLOS_TESTS_NODES_ALONE_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "msgs/bus.h"
#include "msgs/health.pb-c.h"
#include "recon/survey.h"

struct alone {
    const char *folder, *node;
    char log[128]; /* file of what the node says */
    pid_t pid;
    struct bus *listener;
    Anlos__Health *health; /* the newest of the node; NULL: none yet */
    int64_t end_ns;        /* it takes no longer than that */
};

int64_t alone_now_ns(void);

/* A bus of the test's in the folder; node NULL: it only listens. */
struct bus *alone_bus(const char *folder, const char *node);

/* Is somebody connected to this topic of the bus's?  From then on all is delivered. */
bool alone_is_heard(struct bus *b, const struct topic *t);

/* Starts bin/anlos-NODE in a folder with a launch file of that text. */
void alone_start(struct alone *a, const char *folder, const char *node,
                 const char *launch);

/* The same with another program that is this node. */
void alone_start_program(struct alone *a, const char *program, const char *folder,
                         const char *node, const char *launch);

/* Takes what comes within 20 ms.  true: *out is a message of another topic than health,
 * to be freed. */
bool alone_hear(struct alone *a, struct bus_message *out);

/* Of the newest health; 0: nothing is said of it. */
uint64_t alone_device(const struct alone *a, const char *count);
bool alone_publishes_to(const struct alone *a, const char *topic); /* anybody */
bool alone_is(const struct alone *a, Anlos__Health__State state);

/* What the node said, so far; free() it. */
char *alone_log(const struct alone *a);

/* Asks it to stop, waits for that, and asserts that it ended as it should. */
void alone_stop(struct alone *a);
void alone_end(struct alone *a, int exit_code); /* the same, with another exit code */

/* A bumper of 4 speakers and 16 microphones before a wall 0.8 m away, and an image of a
 * lane behind it.  Borrows from what is static. */
struct survey alone_survey(void);
void alone_tell_survey(struct bus *array, const struct survey *s);

#endif
