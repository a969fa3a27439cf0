/* SPDX-License-Identifier: MIT */
/* hal/stage/gpio.h -- lines of a GPIO chip.  One header, two implementations: gpio_v1.c
 * for libgpiod 1.x, gpio_v2.c for 2.x; the build takes the one that fits what is
 * installed.
 */
#ifndef ANLOS_HAL_STAGE_GPIO_H
#define ANLOS_HAL_STAGE_GPIO_H

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"

enum { GPIO_MAX_LINES = 8 };

enum gpio_pull { GPIO_PULL_AS_IS, GPIO_PULL_UP, GPIO_PULL_DOWN };

struct gpio_line {
    const char *name; /* or its offset in decimal; NULL: this line is not there */
    bool input;       /* with edge events; else an output, inactive at first */
    bool active_low;
    enum gpio_pull pull; /* of an input */
};

struct gpio;

/* chip: a path, the name of a device in /dev, or a chip's label.  lines[n], n at most
 * GPIO_MAX_LINES; consumer is what others see as the lines' user.  0, -EINVAL, -ENOENT
 * (no such chip or line), -EBUSY (somebody has it), -EACCES, -ENOMEM, other -errno. */
int gpio_open(struct gpio **out, const char *chip, const struct gpio_line *lines,
              size_t n, const char *consumer, struct error *why);

/* A line that is not there takes everything.  0, -errno. */
int gpio_set(struct gpio *g, size_t line, bool active);

/* Bit i: input i is active now, or became so since the last call.  0, -errno. */
int gpio_inputs(struct gpio *g, unsigned *active);

/* Descriptors that are readable once an input has changed: fds[GPIO_MAX_LINES].  Returns
 * how many. */
size_t gpio_poll(const struct gpio *g, struct pollfd *fds);
void gpio_close(struct gpio *g);

/* gpio_chip.c, for both: which device file a chip's name means. */
enum { GPIO_CHIP_PATH_SIZE = 128 };

/* chip: "/dev/gpiochip0", "gpiochip0" or a label, for which the kernel is asked.  0,
 * -ENOENT. */
int gpio_chip_path(char out[GPIO_CHIP_PATH_SIZE], const char *chip, struct error *why);

/* A line given as a decimal number: its offset, or -1. */
int gpio_chip_offset(const char *line);

#endif
