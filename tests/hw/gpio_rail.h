/* SPDX-License-Identifier: MIT */
/* tests/hw/gpio_rail.h -- a rail at the guest's GPIO chip: a thread that counts the
 * pulses on the step line, and pulls the switches' lines where the stage client reaches
 * them.
 */
#ifndef ANLOS_TESTS_HW_GPIO_RAIL_H
#define ANLOS_TESTS_HW_GPIO_RAIL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

/* Lines of the chip. */
enum {
    RAIL_STEP,
    RAIL_DIRECTION,
    RAIL_ENABLE,
    RAIL_HOME,
    RAIL_LIMIT,
    RAIL_ESTOP,
    RAIL_LINES
};

struct gpio_rail {
    _Atomic long position;           /* steps */
    _Atomic unsigned long steps;     /* pulses */
    _Atomic unsigned long unpowered; /* of them without enable */
    _Atomic long home_at, limit_at;  /* the switches are closed from there on */
    /* At so many pulses the emergency stop is pressed, and let go of at once. */
    _Atomic unsigned long tap_at;
    struct gpio_rail_insides *insides;
};

/* pulse_us: how long a pulse lasts, and the pause after it, at least.  inverted: the
 * switches' and the enable line are active low.  NULL where there is no such chip. */
struct gpio_rail *gpio_rail_start(long position, long home_at, long limit_at,
                                  long pulse_us, bool inverted);
void gpio_rail_press(struct gpio_rail *r, bool pressed); /* the emergency stop */
bool gpio_rail_enabled(struct gpio_rail *r);
void gpio_rail_stop(struct gpio_rail *r);

#endif
