/* SPDX-License-Identifier: MIT */
/* nodes/play/account.h -- the pings that have been played and not been used yet, so that
 * no more are under way than the consumers' queues hold.
 *
 * Each ping is answered by one receipt: a background by dsp, one of the scene by recon,
 * and by dsp whatever it has no use for.  Those of one pass that were used come in the
 * order in which they were played, so that a receipt tells what was lost before it. */
#ifndef ANLOS_NODES_PLAY_ACCOUNT_H
#define ANLOS_NODES_PLAY_ACCOUNT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/scan.pb-c.h"

#define ACCOUNT_MAX 64

struct account_ping {
    uint32_t scan, position, speaker, frame;
    Anlos__Pass pass;
    bool valid; /* false: no use is expected */
};

struct account {
    struct account_ping under_way[ACCOUNT_MAX]; /* [n], the oldest first */
    size_t n;
    uint64_t played, used, unused, missing;
};

void account_play(struct account *a, const struct account_ping *ping);

/* false: nobody waits for it. */
bool account_receipt(struct account *a, const Anlos__Receipt *r);

/* What is under way will not be answered any more: counts it as missing; returns how
 * many. */
size_t account_give_up(struct account *a);

/* The same where nobody cares any more: after a seek. */
void account_forget(struct account *a);

#endif
