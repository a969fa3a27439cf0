/* SPDX-License-Identifier: MIT */
/* hal/stage/gpio_chip.h -- which device file a chip's name means, for both
 * implementations of hal/stage/gpio.h. */
#ifndef ANLOS_HAL_STAGE_GPIO_CHIP_H
#define ANLOS_HAL_STAGE_GPIO_CHIP_H

#include "dsp/error.h"

enum { GPIO_CHIP_PATH_SIZE = 128 };

/* chip: "/dev/gpiochip0", "gpiochip0" or a label, for which the kernel is asked.  0,
 * -ENOENT. */
int gpio_chip_path(char out[GPIO_CHIP_PATH_SIZE], const char *chip, struct error *why);

/* A line given as a decimal number: its offset, or -1. */
int gpio_chip_offset(const char *line);

#endif
