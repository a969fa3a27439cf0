/* SPDX-License-Identifier: MIT */
/* hal/can/backends.h -- the tables that canbus_open chooses from. */
#ifndef ANLOS_HAL_CAN_BACKENDS_H
#define ANLOS_HAL_CAN_BACKENDS_H

#include "hal/canbus.h"

extern const struct canbus_ops canbus_log_ops;
extern const struct canbus_ops canbus_sim_ops;
extern const struct canbus_ops canbus_socketcan_ops;

#endif
