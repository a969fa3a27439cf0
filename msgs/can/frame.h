/* SPDX-License-Identifier: MIT */
/* msgs/can/frame.h -- one CAN frame, classic or FD. */
#ifndef ANLOS_MSGS_CAN_FRAME_H
#define ANLOS_MSGS_CAN_FRAME_H

#include <stdbool.h>
#include <stdint.h>

struct can_frame_data {
    uint32_t id;
    uint8_t size; /* 0..8; up to 64 when fd */
    bool fd;
    uint8_t data[64];
};

#endif
