/* SPDX-License-Identifier: MIT */
/* nodes/scan/pending_fire.h -- the fire command that the scan gave out last.  It may get
 * lost on its way, so it is sent again until a ping answers it; the array knows one that
 * it has had. */
#ifndef ANLOS_NODES_SCAN_PENDING_FIRE_H
#define ANLOS_NODES_SCAN_PENDING_FIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "msgs/array.pb-c.h"

struct pending_fire {
    Anlos__FireCommand command;
    uint32_t *speakers; /* [n_speakers of the survey], the command's */
    bool answered;
    int64_t sent_ns; /* the last time */
};

/* Nothing is given out; ids go on where they were.  0, -ENOMEM. */
int pending_fire_reset(struct pending_fire *v, size_t n_speakers);

/* A new command with the next id; speakers[n] are copied. */
void pending_fire_load(struct pending_fire *v, uint32_t scan, const uint32_t *speakers,
                       size_t n);

/* What is to be published; it borrows from v. */
Anlos__FireCommand pending_fire_send(struct pending_fire *v, int64_t now_ns);

/* A ping has come of it: no need to send it again. */
void pending_fire_answer(struct pending_fire *v);
bool pending_fire_is_due(const struct pending_fire *v, int64_t now_ns);
void pending_fire_clear(struct pending_fire *v);

#endif
