/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/echo.h -- `anlos topic echo`: messages as they come, on stdout. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_ECHO_H
#define ANLOS_NODES_ANLOS_TOPIC_ECHO_H

#include <stdbool.h>
#include <stddef.h>

#include "msgs/bus.h"

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

#endif
