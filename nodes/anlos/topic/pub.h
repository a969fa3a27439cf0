/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/pub.h -- `anlos topic pub`: messages from outside, as JSON.
 *
 * Who may say what.  "ego", "ambient" and "wall/given" are what the vehicle says, and
 * "stage/manual" what a person does: these have a name in msgs/topics.h that is no
 * node's (vehicle, hand), under which they are published, unless a node says the same
 * already (can).  Everything else is a node's own word, and with it what the sensor
 * states: only by force, only in the name of a node that does not run. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_PUB_H
#define ANLOS_NODES_ANLOS_TOPIC_PUB_H

#include <stdbool.h>
#include <stddef.h>

#include "msgs/topics.h"

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
