/* hal/stage/stepper_gpio.h -- a stepper's lines on a GPIO chip, and its clock:
 * CLOCK_MONOTONIC, by absolute timers. */
#ifndef ANLOS_HAL_STAGE_STEPPER_GPIO_H
#define ANLOS_HAL_STAGE_STEPPER_GPIO_H

#include "hal/stage/gpio.h"
#include "hal/stage/stepper.h"

struct stepper_gpio {
    struct gpio *gpio; /* lines as enum stepper_line has them; not owned */
    void *owner;
    bool (*cancelled)(void *owner); /* also the place to say where the stage is */
};

/* The functions take g as their state: it has to live as long as they are used. */
struct stepper_io stepper_gpio_io(struct stepper_gpio *g);

/* At rest: until an input changes or wake_fd is readable, or for a second. */
void stepper_gpio_rest(struct stepper_gpio *g, int wake_fd);

#endif
