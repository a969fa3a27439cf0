/* SPDX-License-Identifier: MIT */
/* msgs/can/protection.h -- the end-to-end protection of our frames: profile 11 on those
 * of 8 bytes, profile 5 on FD.  The data ID of a frame is its identifier, so it tells the
 * sensor and the frame; each identifier counts for itself, all frames of it. */
#ifndef ANLOS_MSGS_CAN_PROTECTION_H
#define ANLOS_MSGS_CAN_PROTECTION_H

#include <stdint.h>

#include "msgs/can/e2e.h"
#include "msgs/can/frame.h"
#include "msgs/can/layout.h"

/* How far a counter may have gone on: two frames in a row may get lost. */
#define CAN_MAX_DELTA 3

/* Of one sender, all zero at the start.  Indexed by identifier - base. */
struct can_protection {
    uint32_t base;
    uint8_t counters[CAN_SENSOR_STEP]; /* of the next frame */
};

/* Of one receiver, all zero at the start. */
struct can_checks {
    uint32_t base;
    struct e2e_check checks[CAN_SENSOR_STEP];
};

/* Writes CRC, counter and nibble into a frame of ours; any other is left alone.  The
 * counter goes on with can_protection_sent, so that a frame that the bus did not take and
 * that is tried again leaves no gap. */
void can_protect(const struct can_protection *p, struct can_frame_data *f);
void can_protection_sent(struct can_protection *p, const struct can_frame_data *f);

/* E2E_WRONG_CRC also when the frame is none of ours or not as long as it should be. */
enum e2e_verdict can_check(struct can_checks *c, const struct can_frame_data *f);

/* What comes next of this identifier is the first one: after a time-out. */
void can_checks_forget(struct can_checks *c, enum can_id id);

#endif
