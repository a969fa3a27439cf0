/* hal/canbus.h -- where CAN frames go.  Backend by URI:
 *   log:out.candump            the format of `candump -L`, interface name "can0"
 *   log:out.candump?interface=vcan1
 *   socketcan:can0             a raw socket, classic and FD */
#ifndef ANLOS_HAL_CANBUS_H
#define ANLOS_HAL_CANBUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "hal/device_count.h"
#include "msgs/can/frames.h"
#include "msgs/complaint.h"

struct canbus_ops {
    const char *scheme;
    int (*open)(void **state, const char *arg, struct complaint *why);
    int (*send)(void *state, const struct can_frame_data *frame, int64_t stamp_ns);
    int (*flush)(void *state);
    /* May be NULL: nothing is counted. */
    size_t (*counts)(void *state, struct device_count out[DEVICE_MAX_COUNTS]);
    void (*close)(void *state);
};

struct canbus;

/* 0, -EINVAL, -ENODEV (no such scheme or interface), -ENOMEM, a negative errno of the
 * file or socket; the complaint names the URI. */
int canbus_open(struct canbus **out, const char *uri, struct complaint *why);

/* stamp_ns: time of sending, written into a log.  An FD frame is filled up with zeros to
 * the next legal size.  0, -EINVAL (size or identifier), -EOPNOTSUPP (FD on a classic
 * interface), -ENOBUFS (try again), -ENOSPC, -ENETDOWN, -EIO. */
int canbus_send(struct canbus *b, const struct can_frame_data *frame, int64_t stamp_ns);

/* A list of frames is complete: a log writes it out whole.  0 or as canbus_send. */
int canbus_flush(struct canbus *b);
/* How many counts there are. */
size_t canbus_counts(struct canbus *b, struct device_count out[DEVICE_MAX_COUNTS]);
void canbus_close(struct canbus *b);

#endif
