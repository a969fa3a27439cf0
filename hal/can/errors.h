/* hal/can/errors.h -- what the error frames of a CAN controller say of its state, and
 * how often.  They are the kernel's (linux/can/error.h); states as in ISO 11898-1: error
 * active, warning from 96 errors counted, passive from 128, bus-off from 256. */
#ifndef ANLOS_HAL_CAN_ERRORS_H
#define ANLOS_HAL_CAN_ERRORS_H

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

#endif
