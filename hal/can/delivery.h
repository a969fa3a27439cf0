/* hal/can/delivery.h -- what became of the frames that the kernel took.
 *
 * One that it took may never reach the bus: it waits in the interface's queue, and is
 * thrown away with it when the controller goes off or the interface down.  So a frame is
 * pending until its echo comes, which a controller's driver gives back once the frame is
 * on the bus and acknowledged (Documentation/networking/can.rst of the kernel, "Local
 * Loopback of Sent Frames"). */
#ifndef ANLOS_HAL_CAN_DELIVERY_H
#define ANLOS_HAL_CAN_DELIVERY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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
