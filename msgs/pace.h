/* SPDX-License-Identifier: MIT */
/* msgs/pace.h -- how fast bytes may follow each other: a leaky bucket.  A PUB socket
 * drops what comes while the message before has not gone into the kernel's buffer yet,
 * and tells nobody; so a sender keeps to a pace at which a reader that is awake keeps up.
 */
#ifndef ANLOS_MSGS_PACE_H
#define ANLOS_MSGS_PACE_H

#include <stdint.h>

struct pace {
    double rate_bytes_s;
    double burst_bytes; /* that may be under way when the next message starts */
    double level_bytes; /* under way at stamp_ns; 0 at first */
    int64_t stamp_ns;
};

/* How long after now_ns the next message may start.  A message that is larger than the
 * burst is not held back for its own size, only the one behind it. */
int64_t pace_delay_ns(const struct pace *p, int64_t now_ns);

/* This many bytes started at now_ns. */
void pace_spend(struct pace *p, int64_t now_ns, double bytes);

#endif
