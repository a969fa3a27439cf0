/* SPDX-License-Identifier: MIT */
/* nodes/anlos/bag/info.h -- how much of each topic is in a bag: by the message
 * indexes alone where there are any, else by reading all of it. */
#ifndef ANLOS_NODES_ANLOS_BAG_INFO_H
#define ANLOS_NODES_ANLOS_BAG_INFO_H

#include "msgs/bag/catalog.h"

struct topic_contents {
    struct bytes name, type;      /* borrowed from the catalog; without a schema empty */
    uint64_t n_messages, n_bytes; /* of their records, before compression */
    uint64_t first_time, last_time;
    char from[96]; /* names of the nodes, spaces between; what does not fit is cut */
};

struct contents {
    struct topic_contents *topics; /* [n] in the order of the bag's channels */
    size_t n;
    uint16_t topic_of[1 << 16];         /* by channel id: index */
    uint64_t packed_bytes, plain_bytes; /* of all chunks; 0: not known */
    struct bytes compression;           /* of the first chunk */
};

/* Clear with contents_clear, also after an error.  The catalog outlives it.  0, -EBADMSG,
 * -EINTR (Ctrl-C), other errors of bag_reader_next. */
int contents_read(struct contents *out, const struct bag_catalog *c, struct error *why);
void contents_clear(struct contents *c);

/* Messages a second; 0: fewer than two, or all at one time. */
double topic_rate_hz(const struct topic_contents *t);

#endif
