/* SPDX-License-Identifier: MIT */
/* hal/can/isotp.h -- messages that are longer than a frame: the server's side of ISO
 * 15765-2 (ISO-TP) on a CAN interface, by the kernel's sockets (Linux 5.10 and later,
 * module can_isotp).  Classic frames, normal addressing; identifiers above 0x7ff have 29
 * bits; what is sent is padded to 8 bytes. */
#ifndef ANLOS_HAL_CAN_ISOTP_H
#define ANLOS_HAL_CAN_ISOTP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

struct isotp_address {
    const char *interface;
    uint32_t request, response;
    uint32_t functional; /* requests to all servers, of one frame; 0: none are heard */
};

struct isotp;

/* 0, -ENOTSUP (the kernel has no such sockets), -ENODEV (no interface of that name),
 * -ENOMEM, other negative errno, with an error. */
int isotp_open(struct isotp **out, const struct isotp_address *address,
               struct error *why);

/* The oldest request that was not taken yet, of *n bytes; of one that is longer than size
 * its beginning.  Never waits; an interface that is gone is looked for once a second.
 * 0, -EAGAIN. */
int isotp_receive(struct isotp *t, uint8_t *data, size_t size, size_t *n,
                  bool *functional, int64_t now_ns);

/* To the tester.  0: the kernel sends it; -EBUSY: what was sent before is still on its
 * way; -ENETDOWN, other negative errno. */
int isotp_send(struct isotp *t, const uint8_t *data, size_t n);

/* Messages, of either direction, that broke off: the other side fell silent, or the bus
 * went; and functional ones of more than a frame. */
uint64_t isotp_broken(const struct isotp *t);

void isotp_close(struct isotp *t);

#endif
