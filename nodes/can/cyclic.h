/* SPDX-License-Identifier: MIT */
/* nodes/can/cyclic.h -- what the sensor says without being asked: the status in its cycle
 * and at once when it says something else, the diagnosis, and that there is nothing where
 * images should come and do not.  Time is an argument. */
#ifndef ANLOS_NODES_CAN_CYCLIC_H
#define ANLOS_NODES_CAN_CYCLIC_H

#include <stdbool.h>
#include <stdint.h>

#include "msgs/can/load.h"
#include "nodes/can/diagnosis.h"
#include "nodes/can/outbox.h"
#include "nodes/can/sender.h"
#include "nodes/can/watch.h"

struct cyclic { /* the first four are the caller's */
    struct sender *sender;
    struct outbox *outbox;
    struct diagnosis *diagnosis;
    const struct watch *watch;
    int64_t status_due_ns, diagnosis_due_ns, empty_due_ns;
    struct can_frame_data status;           /* as it went out last */
    int64_t changed_ns[CAN_STATUS_CHANGES]; /* of the newest changes, a ring; 0: none */
    size_t n_changes;
};

/* Puts into the outbox what is due.  To be called as often as watch_step.  More changes
 * of the status in a second than CAN_STATUS_CHANGES wait for its cycle. */
void cyclic_step(struct cyclic *c, int64_t now_ns);

/* When the next status is due. */
int64_t cyclic_due_ns(const struct cyclic *c);

#endif
