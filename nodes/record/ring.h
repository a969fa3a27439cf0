/* SPDX-License-Identifier: MIT */
/* nodes/record/ring.h -- the last seconds of all that comes over a bus, in memory: whole
 * messages, bounded in time and in bytes.  Those of up to 512 kB are copied into segments
 * of 2 MB, of which each goes back to the system with its last message, but one: memory
 * that follows what is there.  Larger ones, and what may stay for the beginnings of bags,
 * keep the memory that they came in.
 *
 * What a bag needs from its beginning stays when it is too old for the rest: the newest
 * survey, and the pings of a scan's room without the objects (its background), which come
 * once.  They count as bytes, too; a background of more than half of all goes as a whole.
 */
#ifndef ANLOS_NODES_RECORD_RING_H
#define ANLOS_NODES_RECORD_RING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/bus.h"

struct ring_entry {
    struct bus_message message; /* payload NULL: so many of its topic got lost here */
    uint64_t lost;
    int64_t came_ns;
    bool background; /* a ping of the room without the objects... */
    uint32_t scan;   /* ...of this scan */
    bool stored;     /* its payload is in a segment */
};

struct ring_config {
    int64_t span_ns;
    size_t max_bytes;
    /* A held entry that goes all the same, as there is no room; or NULL. */
    void (*overrun)(void *context, const struct ring_entry *e);
    void *context;
};

struct ring_totals {
    size_t bytes;             /* of all that is there */
    size_t background_bytes;  /* of them: of pings of a background that are older */
    size_t store_bytes;       /* of all segments */
    size_t n;                 /* entries */
    int64_t oldest_ns;        /* came then; 0: there is none */
    uint64_t shortened;       /* entries that went before their time, for want of room */
    uint64_t background_gone; /* pings of a background that did not fit */
};

struct ring;

/* 0, -ENOMEM. */
int ring_create(struct ring **out, const struct ring_config *cfg);

/* Takes the message over.  What is older than the span goes, then the oldest until all is
 * within max_bytes; one message alone that is larger is not kept.  0, -ENOMEM (it is
 * freed). */
int ring_put(struct ring *r, struct bus_message *m, int64_t came_ns);

/* n messages of the topic got lost by then.  0, -ENOMEM. */
int ring_lost(struct ring *r, const struct topic *t, uint64_t n, int64_t came_ns);

/* Entries have numbers, from 0 on.  NULL: it is gone, or not there yet. */
const struct ring_entry *ring_at(const struct ring *r, uint64_t number);
uint64_t ring_begin(const struct ring *r); /* the oldest that is there */
uint64_t ring_end(const struct ring *r);   /* the next one */

/* What stays for a bag's beginning, the survey first; NULL: no more. */
const struct ring_entry *ring_kept(const struct ring *r, size_t i);

/* From this one on nothing goes by its age, until another call; UINT64_MAX: nothing is
 * held. */
void ring_hold(struct ring *r, uint64_t number);

/* What is too old by now goes. */
void ring_trim(struct ring *r, int64_t now_ns);

/* What an entry counts as. */
size_t ring_cost(const struct ring_entry *e);
void ring_sum(const struct ring *r, struct ring_totals *out);
void ring_destroy(struct ring *r);

#endif
