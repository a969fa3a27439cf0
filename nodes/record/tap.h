/* SPDX-License-Identifier: MIT */
/* nodes/record/tap.h -- what comes over a bus, into a recorder, and into a snapshot that
 * keeps the last seconds of it. */
#ifndef ANLOS_NODES_RECORD_TAP_H
#define ANLOS_NODES_RECORD_TAP_H

#include <stddef.h>

#include "dsp/error.h"
#include "hal/clock.h"
#include "msgs/bus.h"
#include "msgs/topics.h"
#include "nodes/record/recorder.h"
#include "nodes/record/snapshot.h"

#define TAP_QUEUE_BYTES ((size_t)256 << 20) /* 10 s of a scan at four times its pace */

struct tap {
    struct bus *bus;
    struct recorder *recorder; /* NULL: no file of all, or none any more */
    struct snapshot *snapshot; /* NULL: none */
    const struct topic *const *topics;
    size_t n_topics;
    const struct clock_source *clock;
    int64_t due_ns; /* when tap_step is to be called again; INT64_MAX: for a message */
    int64_t count_due_ns, trim_due_ns;
    uint64_t messages, lost;  /* of its topics, taken and not */
    struct bus_count *counts; /* [room] */
    size_t room;
    int stopped; /* what ended the recorder while the snapshot goes on; 0: nothing did */
    struct error stopped_why;
};

/* A tap on a bus that subscribes to nothing yet: topics[n], which outlive it, and what
 * the snapshot wants beside.  0, -ENOMEM, as bus_subscribe. */
int tap_open(struct tap *t, struct bus *bus, struct recorder *recorder,
             struct snapshot *snapshot, const struct topic *const *topics, size_t n,
             const struct clock_source *clock);

/* Takes at most one message, waiting for it no longer than timeout_ms, and has the
 * recorder flush and the snapshot write when it is time.  0; errors of bus_receive but
 * -ETIMEDOUT; of the recorder, where there is no snapshot that goes on without it. */
int tap_step(struct tap *t, int timeout_ms, struct error *why);

/* Takes what was published before now and is still on its way or waits: until nothing
 * comes for a moment.  Ends an interrupt.  As tap_step. */
int tap_drain(struct tap *t, struct error *why);

void tap_close(struct tap *t);

/* The topics to be recorded, by patterns (nodes/rt/patterns.h). */

struct choice {
    const struct topic **topics; /* [n] */
    size_t n;
};

/* exclude may be NULL.  0, -EINVAL (a pattern that no topic matches, or nothing is left),
 * -ENOMEM. */
int choice_make(struct choice *c, const char *topics, const char *exclude,
                struct error *why);
void choice_clear(struct choice *c);

#endif
