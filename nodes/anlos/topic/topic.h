/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/topic.h -- verbs of `anlos topic` with a file of their own. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_TOPIC_H
#define ANLOS_NODES_ANLOS_TOPIC_TOPIC_H

#include <stdbool.h>
#include <stddef.h>

#include "msgs/bus.h"
#include "msgs/topics.h"

/* `anlos topic echo`: messages as they come, on stdout. */

struct echo_options {
    size_t count;      /* 0: without end */
    double timeout_s;  /* without a message; 0: never */
    const char *field; /* only this one; NULL: the whole line */
    bool full;
    bool mcap; /* in place of JSON */
};

/* What got lost on the way goes to stderr, once a second at most and at the end; so does,
 * after 2 s, that nothing comes.  0 (count, or nobody reads on), -EINTR, -ETIMEDOUT,
 * -ENOMEM; what cannot be written shows in ferror(stdout). */
int echo_run(struct bus *bus, const struct topic *const *topics, size_t n,
             const struct echo_options *o);

/* `anlos topic pub`: messages from outside, as JSON.
 *
 * Who may say what.  "ego", "ambient" and "wall/given" are what the vehicle says, and
 * "stage/manual" what a person does: these have a name in msgs/topics.h that is no
 * node's (vehicle, hand), under which they are published, unless a node says the same
 * already (can).  Everything else is a node's own word, and with it what the sensor
 * states: only by force, only in the name of a node that does not run. */

struct pub_options {
    const char *json; /* NULL or "-": from stdin, one a line */
    const char *from; /* in whose name; NULL: as above */
    double rate_hz;   /* a message of `json` again and again, lines at most so fast; 0:
                       * once,   as they come */
    size_t count;     /* 0: once, or to the end of stdin or Ctrl-C */
    bool force;
    bool print; /* each as echo prints it, when it is published */
};

/* An exit code; says what is wrong. */
int pub_run(const char *run_dir, const struct topic *t, const struct pub_options *o);

#endif
