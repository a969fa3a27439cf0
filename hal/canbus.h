/* SPDX-License-Identifier: MIT */
/* hal/canbus.h -- where CAN frames go, and come from.  Backend by URI:
 *   log:out.candump            the format of `candump -L`, interface name "can0"; nothing
 *                              ever comes
 *   log:out.candump?interface=vcan1
 *   log:out.candump?append=yes  goes on where the file ends; no (default): empties it
 *   socketcan:can0             a raw socket, classic and FD (hal/can/socketcan.c)
 *   sim:drive.yaml?log=out.candump  the same log, and a simulated vehicle that tells its
 *                              motion and its air (hal/can/sim.c) */
#ifndef ANLOS_HAL_CANBUS_H
#define ANLOS_HAL_CANBUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/device.h"
#include "msgs/can/frames.h"

enum { CANBUS_MAX_COUNTS = 15 };

/* In the order of how bad it is.  From CANBUS_SILENT on nothing is known to go out; in
 * CANBUS_SILENT and CANBUS_OFF a frame may be tried. */
enum canbus_state {
    CANBUS_READY,
    CANBUS_WARNING, /* the controller counts many errors */
    CANBUS_PASSIVE, /* and more: soon it leaves the bus */
    CANBUS_SILENT,  /* for a second it has confirmed no frame: nobody acknowledges */
    CANBUS_OFF,     /* the controller left the bus until it is restarted */
    CANBUS_DOWN,    /* the interface is there, and down */
    CANBUS_GONE,    /* there is no interface of that name any more */
};

struct canbus_status {
    enum canbus_state state;
    char text[256];   /* what is wrong and what to do about it; empty when ready */
    size_t pending;   /* frames that were taken and are not on the bus yet */
    uint64_t outages; /* times that pending frames were thrown away, by bus-off or so */
};

struct canbus_ops {
    const char *scheme;
    int (*open)(void **state, const char *arg, struct error *why);
    /* May be NULL: opening leaves nothing behind. */
    int (*check)(const char *arg, struct error *why);
    int (*send)(void *state, const struct can_frame_data *frame, int64_t stamp_ns);
    int (*flush)(void *state);
    /* These three may be NULL: nothing ever comes. */
    int (*listen)(void *state, const uint32_t *ids, size_t n);
    int (*receive)(void *state, struct can_frame_data *out, int64_t now_ns,
                   int64_t *came_ns);
    int (*fd)(const void *state);
    /* May be NULL: always ready, and what was sent is on the bus. */
    void (*poll)(void *state, int64_t now_ns, struct canbus_status *out);
    /* May be NULL: nothing is counted. */
    size_t (*counts)(void *state, struct device_count out[CANBUS_MAX_COUNTS]);
    void (*close)(void *state);
};

/* The tables that canbus_open chooses from. */
extern const struct canbus_ops canbus_log_ops;
extern const struct canbus_ops canbus_sim_ops;
extern const struct canbus_ops canbus_socketcan_ops;

struct canbus;

/* 0, -EINVAL, -ENODEV (no such scheme or interface), -ENOMEM, a negative errno of the
 * file or socket; the error names the URI. */
int canbus_open(struct canbus **out, const char *uri, struct error *why);

/* As it was opened, for who tells what went wrong; it lives as long as b. */
const char *canbus_uri(const struct canbus *b);

/* Is it all right as it is written, is what it names there?  As canbus_open, but nothing
 * is written, and a log may be of a folder that is still to come. */
int canbus_check(const char *uri, struct error *why);

/* Never waits.  stamp_ns: time of sending, written into a log.  An FD frame is filled up
 * with zeros to the next legal size.  0; -EINVAL (size or identifier, or more different
 * identifiers than 16); -EOPNOTSUPP (FD on a classic interface); -ENOBUFS (full, try
 * again); -ENETDOWN (canbus_poll tells why and when it works again); -ENOSPC, -EIO. */
int canbus_send(struct canbus *b, const struct can_frame_data *frame, int64_t stamp_ns);

/* A list of frames is complete: a log writes it out whole.  0 or as canbus_send. */
int canbus_flush(struct canbus *b);

/* From now on frames of others with these identifiers are received, and none but these;
 * one's own never are.  The first is EgoMotion: a simulated vehicle talks to that sensor.
 * n: up to CANBUS_MAX_INPUTS.  0, -EINVAL, -EOPNOTSUPP (nothing ever comes over this
 * bus), a negative errno of the socket. */
enum { CANBUS_MAX_INPUTS = 5 };
int canbus_listen(struct canbus *b, const uint32_t *ids, size_t n);

/* The oldest frame that has come and was not taken yet.  came_ns: when it was on the bus,
 * which is before now_ns if this program was kept waiting; NULL: nobody wants to know.
 * Never waits.  0, -EAGAIN. */
int canbus_receive(struct canbus *b, struct can_frame_data *out, int64_t now_ns,
                   int64_t *came_ns);

/* A descriptor that poll(2) finds readable when frames have come, or something else for
 * canbus_poll has; it may change with each call on the bus.  -1: there is none now. */
int canbus_fd(const struct canbus *b);

/* Takes in what has happened since: frames confirmed, errors of the bus, an interface
 * that went or came back.  To be called often while something is to be sent.  Never
 * waits. */
void canbus_poll(struct canbus *b, int64_t now_ns, struct canbus_status *out);

/* How many counts there are. */
size_t canbus_counts(struct canbus *b, struct device_count out[CANBUS_MAX_COUNTS]);
void canbus_close(struct canbus *b);

#endif
