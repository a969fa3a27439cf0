/* SPDX-License-Identifier: MIT */
/* nodes/scan/ping_tracker.h -- the account of every ping of a scan: to be fired, under
 * way, used, or given up.
 *
 * Pings pass through array, dsp and recon in the order of firing.  So a receipt for a
 * later one says that an earlier one without a receipt was lost on the way; only the last
 * ones need a time-out. */
#ifndef ANLOS_NODES_SCAN_PING_TRACKER_H
#define ANLOS_NODES_SCAN_PING_TRACKER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/tensor.pb-c.h"

struct ping_tracker_size {
    bool background; /* a pass without the objects is needed too */
    size_t n_positions, n_speakers;
    unsigned retries; /* of one ping, before it is given up */
};

struct ping_tracker_ping {
    Anlos__Pass pass;
    size_t position, speaker;
};

struct ping_tracker_count {
    size_t expected, done, lost;
    size_t recording;  /* fired, and not yet known to be recorded */
    size_t under_way;  /* fired, without a receipt */
    size_t scene_done; /* of the scene pass alone */
    unsigned retaken;  /* firings of a ping that had been fired before */
};

struct ping_tracker;

/* 0, -EINVAL, -ENOMEM. */
int ping_tracker_create(struct ping_tracker **out, const struct ping_tracker_size *size);
void ping_tracker_count(const struct ping_tracker *l, struct ping_tracker_count *out);

/* The pass to work on: BACKGROUND until all of it is settled. */
Anlos__Pass ping_tracker_pass(const struct ping_tracker *l);

/* Of a position and pass: speakers[n_speakers] that are to be fired; returns how many. */
size_t ping_tracker_missing(const struct ping_tracker *l, Anlos__Pass pass,
                            size_t position, uint32_t *speakers);

/* Events.  A ping that the scan does not have is ignored. */
void ping_tracker_fire(struct ping_tracker *l, const struct ping_tracker_ping *ping);
void ping_tracker_recorded(struct ping_tracker *l, const struct ping_tracker_ping *ping);
void ping_tracker_receipt(struct ping_tracker *l, const struct ping_tracker_ping *ping,
                          bool usable);

/* Everything under way counts as missed once. */
void ping_tracker_time_out(struct ping_tracker *l);

/* A process was restarted.  What was under way is fired again, without counting as a
 * retry; what it had kept is gone: */
void ping_tracker_forget_under_way(struct ping_tracker *l);
void ping_tracker_forget_background(
    struct ping_tracker *l); /* dsp: where the scene still needs it */
void ping_tracker_forget_scene(struct ping_tracker *l); /* recon: all traces */

void ping_tracker_destroy(struct ping_tracker *l);

#endif
