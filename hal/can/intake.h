/* hal/can/intake.h -- frames that have come and wait to be taken, the oldest first. */
#ifndef ANLOS_HAL_CAN_INTAKE_H
#define ANLOS_HAL_CAN_INTAKE_H

#include <stddef.h>
#include <stdint.h>

#include "msgs/can/frame.h"

#define CAN_INTAKE_MAX 64 /* a second of all inputs */

struct can_intake {                               /* all zero: empty */
    struct can_frame_data frames[CAN_INTAKE_MAX]; /* a ring */
    int64_t came_ns[CAN_INTAKE_MAX];
    size_t first, n;
    uint64_t received, dropped;
};

/* Of a full one the oldest goes. */
void can_intake_put(struct can_intake *i, const struct can_frame_data *f,
                    int64_t came_ns);

/* 0, -EAGAIN (it is empty). */
int can_intake_take(struct can_intake *i, struct can_frame_data *out, int64_t *came_ns);

#endif
