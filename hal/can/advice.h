/* hal/can/advice.h -- what a person reads of a CAN bus that is not well. */
#ifndef ANLOS_HAL_CAN_ADVICE_H
#define ANLOS_HAL_CAN_ADVICE_H

#include <stddef.h>

#include "hal/canbus.h"

/* "INTERFACE is STATE: what to do"; empty for CANBUS_READY. */
void canbus_advice(char *text, size_t size, enum canbus_state state,
                   const char *interface);

#endif
