/* SPDX-License-Identifier: MIT */
/* nodes/anlos/can/can.h -- `anlos can`: what the frames on the vehicle's bus say. */
#ifndef ANLOS_NODES_ANLOS_CAN_CAN_H
#define ANLOS_NODES_ANLOS_CAN_CAN_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "dsp/error.h"
#include "nodes/anlos/can/tally.h"

struct decode {
    struct tally tally;    /* base: of the sensor */
    uint16_t shown;        /* 1 << enum can_id of what is printed; the rest is counted */
    const char *interface; /* of a file: only this one's; NULL: of all */
    bool json;
    double seconds; /* of an interface: stop then; 0: never */
};

/* Until the end of the file, or interrupt_requested.  0, -EINTR, -EIO, -ENOMEM or what
 * else reading or printing says. */
int decode_file(struct decode *d, FILE *f);

#endif
