/* SPDX-License-Identifier: MIT */
/* nodes/anlos/topic/mcap_pipe.h -- messages of the bus as a bag (MCAP) that goes into a
 * pipe: without chunks, index and summary, each message as soon as it comes, behind its
 * schema and channel. */
#ifndef ANLOS_NODES_ANLOS_TOPIC_MCAP_PIPE_H
#define ANLOS_NODES_ANLOS_TOPIC_MCAP_PIPE_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "msgs/bag/topic_message.h"

struct mcap_pipe {
    FILE *f;
    struct bytes_buffer out;
    struct bag_source
        *sources; /* [n]: channel id is the index from 1; grown by doubling */
    size_t n;
};

/* Each writes through to f.  0, -ENOMEM, -E2BIG (65535 channels), errno of writing. */
int mcap_pipe_begin(struct mcap_pipe *p, FILE *f);
int mcap_pipe_put(struct mcap_pipe *p, const struct bus_message *m);
int mcap_pipe_end(struct mcap_pipe *p); /* what came is a whole file then */
void mcap_pipe_free(struct mcap_pipe *p);

#endif
