/* SPDX-License-Identifier: MIT */
/* nodes/can/outbox.h -- what waits for the CAN bus: detection lists in their order, and
 * the newest status and diagnosis frame.  Nothing here ever waits itself.  Each frame is
 * protected when it goes, so that the counters tell of every one that did.
 *
 * One list is on its way at a time; the next begins when every frame of it is confirmed
 * to be on the bus.  When the bus breaks off (bus-off, interface down or gone, nobody
 * acknowledges), the list on its way is sent again from its header as soon as it can; so
 * is it, as it may be said then, when its objects must not be sent any more, or not as
 * measured, before all of it is out.
 * When more than OUTBOX_LISTS wait, the oldest that is not on its way is dropped whole.
 * So a receiver that throws away what it has collected at each header sees whole lists
 * only.  A status or diagnosis frame may come between the frames of a list. */
#ifndef ANLOS_NODES_CAN_OUTBOX_H
#define ANLOS_NODES_CAN_OUTBOX_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/canbus.h"
#include "hal/clock.h"
#include "nodes/can/sender.h"

enum { OUTBOX_LISTS = 4, OUTBOX_COUNTS = 4 };

enum outbox_cyclic { OUTBOX_STATUS, OUTBOX_DIAGNOSIS, OUTBOX_CYCLIC };

struct outbox {
    struct canbus *bus;
    const struct clock_source *clock;
    struct sender *sender;
    struct sender_list lists[OUTBOX_LISTS]; /* [n_lists], the oldest first */
    size_t n_lists;
    size_t next; /* frame of the oldest list that goes next; 0: it is not on its way */
    bool cut;    /* a part of the oldest list went out, and it has to begin again */
    struct can_frame_data cyclic[OUTBOX_CYCLIC];
    bool waits[OUTBOX_CYCLIC];
    struct canbus_status health; /* of the bus */
    int64_t begun_ns, last_ns;   /* when the list on its way began, and the one before */
    int64_t probe_ns;            /* when a bus that holds back is tried again */
    int64_t dropped_ns;          /* when a list was last dropped; 0: never */
    int dropped_for;             /* the error that cost it; 0: it was one too many */
    unsigned wait_ms;
    int error; /* of the last frame, when it is not of the bus: a full disk */
    uint64_t sent, dropped, cut_off;
    uint64_t lost;      /* lists and frames that such an error cost, */
    int lost_for;       /* the newest of them */
    uint64_t truncated; /* of those sent */
};

/* What is passed stays the caller's. */
void outbox_init(struct outbox *o, struct canbus *bus, const struct clock_source *clock,
                 struct sender *sender);

/* Takes a list or a frame of a kind; they are copied. */
void outbox_put_list(struct outbox *o, const struct sender_list *list);
void outbox_put_cyclic(struct outbox *o, enum outbox_cyclic kind,
                       const struct can_frame_data *frame);

/* Sends what the bus takes. */
void outbox_step(struct outbox *o);

/* Is there anything that the bus would take now or soon? */
bool outbox_busy(const struct outbox *o);

/* When to step again, at the latest. */
unsigned outbox_wait_ms(const struct outbox *o);

/* False: text says what is wrong. */
bool outbox_well(const struct outbox *o, char *text, size_t size);

/* A log that lacks something: text says how much and why.  false: it is whole, or this
 * is a bus, where a receiver misses what did not come. */
bool outbox_log_lacks(const struct outbox *o, char *text, size_t size);

void outbox_counts(const struct outbox *o, struct device_count out[OUTBOX_COUNTS]);

#endif
