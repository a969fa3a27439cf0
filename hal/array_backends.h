/* SPDX-License-Identifier: MIT */
/* hal/array_backends.h -- the tables that array_open chooses from. */
#ifndef ANLOS_HAL_ARRAY_BACKENDS_H
#define ANLOS_HAL_ARRAY_BACKENDS_H

#include "hal/array.h"

extern const struct array_ops array_alsa_ops;
extern const struct array_ops array_sim_ops;
extern const struct array_ops array_wav_ops;

#endif
