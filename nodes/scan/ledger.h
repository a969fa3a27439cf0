/* nodes/scan/ledger.h -- the account of every ping of a scan: to be fired, under way,
 * used, or given up.
 *
 * Pings pass through array, dsp and recon in the order of firing.  So a receipt for a
 * later one says that an earlier one without a receipt was lost on the way; only the last
 * ones need a time-out. */
#ifndef ANLOS_NODES_SCAN_LEDGER_H
#define ANLOS_NODES_SCAN_LEDGER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/tensor.pb-c.h"

struct ledger_size {
    bool background; /* a pass without the objects is needed too */
    size_t n_positions, n_speakers;
    unsigned retries; /* of one ping, before it is given up */
};

struct ledger_ping {
    Anlos__Pass pass;
    size_t position, speaker;
};

struct ledger_count {
    size_t expected, done, lost;
    size_t recording;  /* fired, and not yet known to be recorded */
    size_t under_way;  /* fired, without a receipt */
    size_t scene_done; /* of the scene pass alone */
    unsigned retaken;  /* firings of a ping that had been fired before */
};

struct ledger;

/* 0, -EINVAL, -ENOMEM. */
int ledger_create(struct ledger **out, const struct ledger_size *size);
void ledger_count(const struct ledger *l, struct ledger_count *out);

/* The pass to work on: BACKGROUND until all of it is settled. */
Anlos__Pass ledger_pass(const struct ledger *l);

/* Of a position and pass: speakers[n_speakers] that are to be fired; returns how many. */
size_t ledger_missing(const struct ledger *l, Anlos__Pass pass, size_t position,
                      uint32_t *speakers);

/* Events.  A ping that the scan does not have is ignored. */
void ledger_fire(struct ledger *l, const struct ledger_ping *ping);
void ledger_recorded(struct ledger *l, const struct ledger_ping *ping);
void ledger_receipt(struct ledger *l, const struct ledger_ping *ping, bool usable);

/* Everything under way counts as missed once. */
void ledger_time_out(struct ledger *l);

/* A process was restarted.  What was under way is fired again, without counting as a
 * retry; what it had kept is gone: */
void ledger_forget_under_way(struct ledger *l);
void ledger_forget_background(struct ledger *l); /* dsp: where the scene still needs it */
void ledger_forget_scene(struct ledger *l);      /* recon: all traces */

void ledger_destroy(struct ledger *l);

#endif
