/* SPDX-License-Identifier: MIT */
/* hal/stage/backends.h -- the tables that stage_open chooses from. */
#ifndef ANLOS_HAL_STAGE_BACKENDS_H
#define ANLOS_HAL_STAGE_BACKENDS_H

#include "hal/stage.h"

extern const struct stage_ops stage_gpiod_ops;
extern const struct stage_ops stage_zaber_ops;
extern const struct stage_ops stage_sim_ops;
extern const struct stage_ops stage_none_ops;

#endif
