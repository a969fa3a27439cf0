/* SPDX-License-Identifier: MIT */
/* hal/can/socket.h -- a raw CAN socket of the kernel on one interface: the system calls
 * of hal/can/socketcan.c, and nothing that remembers. */
#ifndef ANLOS_HAL_CAN_SOCKET_H
#define ANLOS_HAL_CAN_SOCKET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "msgs/can/frames.h"

enum { CAN_SOCKET_MAX_IDS = 21 };

struct can_link {
    bool up;
    bool carrier; /* a controller in bus-off has none */
    bool can_fd;  /* takes FD frames */
};

enum can_event_kind {
    CAN_EVENT_ECHO,    /* a frame of this socket is on the bus */
    CAN_EVENT_FOREIGN, /* somebody else's, with an identifier of the filter */
    CAN_EVENT_ERROR
};

struct can_event {
    enum can_event_kind kind;
    uint32_t id; /* of an error: with the kernel's flags */
    struct can_frame_data frame;
    int64_t held_ns; /* for so long the kernel has had it, by the wall clock, which may
                        have been set meanwhile; 0: it does not say */
};

/* Receives error frames of the kinds in error_mask, and nothing else before
 * can_socket_filter.  *fd: the socket, to be closed with close(2); it never waits.
 * 0, -ENODEV (no interface of that name), other negative errno. */
int can_socket_open(int *fd, const char *interface, uint32_t error_mask,
                    struct error *why);

/* From now on frames with these identifiers are received, echoes of one's own among them.
 * n: up to CAN_SOCKET_MAX_IDS.  0 or a negative errno. */
int can_socket_filter(int fd, const uint32_t *ids, size_t n);

/* 0, -ENODEV (the interface is gone), other negative errno. */
int can_socket_link(int fd, const char *interface, struct can_link *out);

/* 0, or what the kernel says: -ENOBUFS (full), -ENETDOWN, -ENXIO and -ENODEV (the
 * interface is gone). */
int can_socket_send(int fd, const struct can_frame_data *f);

/* The same, and -EAGAIN: nothing is there. */
int can_socket_receive(int fd, struct can_event *out);

#endif
