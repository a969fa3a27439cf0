/* SPDX-License-Identifier: MIT */
/* nodes/anlos/can/decode.h -- frames from a file of candump or an interface, to stdout.
 */
#ifndef ANLOS_NODES_ANLOS_CAN_DECODE_H
#define ANLOS_NODES_ANLOS_CAN_DECODE_H

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

/* Until d->seconds or interrupt_requested.  0, -EINTR, -ENODEV, ... */
int decode_interface(struct decode *d, const char *interface, struct error *why);

#endif
