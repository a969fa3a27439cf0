/* SPDX-License-Identifier: MIT */
/* hal/can/errors.h -- what the error frames of a CAN controller say of its state, and
 * how often.  They are the kernel's (linux/can/error.h); states as in ISO 11898-1: error
 * active, warning from 96 errors counted, passive from 128, bus-off from 256. */
#ifndef ANLOS_HAL_CAN_ERRORS_H
#define ANLOS_HAL_CAN_ERRORS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/canbus.h"

struct canbus_errors {
    enum canbus_state state;        /* CANBUS_READY, _WARNING, _PASSIVE or _OFF */
    uint64_t warning, passive, off; /* times that the controller came to this state */
    uint64_t restarted, arbitration_lost, unacknowledged;
};

/* The kinds of error frames that are counted here, for the socket's error filter. */
uint32_t canbus_errors_mask(void);

/* id with CAN_ERR_FLAG. */
void canbus_errors_take(struct canbus_errors *e, uint32_t id, const uint8_t data[8]);

/* A frame went out: a controller that was off is not any more, even when nobody said. */
void canbus_errors_alive(struct canbus_errors *e);

/* What a person reads of a CAN bus that is not well. */

/* "INTERFACE is STATE: what to do"; empty for CANBUS_READY. */
void canbus_advice(char *text, size_t size, enum canbus_state state,
                   const char *interface);

/* What became of the frames that the kernel took.
 *
 * One that it took may never reach the bus: it waits in the interface's queue, and is
 * thrown away with it when the controller goes off or the interface down.  So a frame is
 * pending until its echo comes, which a controller's driver gives back once the frame is
 * on the bus and acknowledged (Documentation/networking/can.rst of the kernel, "Local
 * Loopback of Sent Frames"). */

struct can_delivery {
    size_t pending;
    bool silent;      /* nothing came back for a second, and has not since */
    int64_t alive_ns; /* of the last echo, or since when frames are pending */
    uint64_t sent, confirmed;
    uint64_t unconfirmed; /* sent = confirmed + unconfirmed + pending */
    uint64_t outages;     /* times that pending frames were given up */
};

void can_delivery_sent(struct can_delivery *d, int64_t now_ns);
void can_delivery_echo(struct can_delivery *d, int64_t now_ns);

/* What is pending was thrown away. */
void can_delivery_lost(struct can_delivery *d);

/* Gives up what has been pending for a second without any echo. */
void can_delivery_check(struct can_delivery *d, int64_t now_ns);

#endif
