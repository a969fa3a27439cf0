/* SPDX-License-Identifier: MIT */
/* hal/stage/zaber_port.h -- questions to a Zaber device and their answers.  Each has a
 * message id, so that a late answer is not taken for that of a later question; one that
 * stays away or is garbled is asked for again. */
#ifndef ANLOS_HAL_STAGE_ZABER_PORT_H
#define ANLOS_HAL_STAGE_ZABER_PORT_H

#include <stdatomic.h>
#include <stdint.h>

#include "dsp/error.h"
#include "hal/device.h"
#include "hal/stage/zaber_message.h"

enum zaber_checksum {
    ZABER_CHECKSUM_AUTO, /* sent once the device has sent one */
    ZABER_CHECKSUM_ON,   /* sent, and asked for */
    ZABER_CHECKSUM_OFF,  /* not sent; one that comes is checked all the same */
};

struct zaber_port_config {
    const char *path; /* not copied */
    unsigned baud, device, axis;
    double timeout_s; /* for an answer, at first */
    enum zaber_checksum checksum;
};

struct zaber_port {
    struct zaber_port_config cfg;
    struct serial *serial; /* NULL: the port is gone */
    int id;
    bool checksums; /* the device sends them */
    _Atomic uint64_t retries, checksum_errors, garbled, stale, reopened;
};

/* 0, or as serial_open. */
int zaber_port_open(struct zaber_port *p, const struct zaber_port_config *cfg,
                    struct error *why);

/* After the port was gone; else nothing.  0, or as serial_open. */
int zaber_port_reopen(struct zaber_port *p);

/* Sends the command and waits for its answer, three times at most, twice as long each
 * time.  0, -EPROTO (rejected: reply->data has why), -ETIMEDOUT, -ENODEV and others: the
 * port is gone. */
int zaber_port_ask(struct zaber_port *p, struct zaber_message *reply, const char *format,
                   ...) __attribute__((format(printf, 3, 4)));

/* Sends, and waits for nothing: for a last "stop". */
void zaber_port_shout(struct zaber_port *p, const char *command);
void zaber_port_close(struct zaber_port *p);

/* What a zaber: stage is named by:
 *
 *   zaber:TTY?pitch_mm=TRAVEL
 *
 * pitch_mm is needed: the travel of a turn of the motor, from the data sheet.  The rest
 * has defaults: steps=200 (full steps of a turn), resolution (microsteps of a full step,
 * of the device), device=1, axis=1, baud=115200, timeout=0.3, checksum=auto, on or off,
 * settle, min, max, homing=first-move or manual.  Metres and seconds. */

struct stage_zaber_options {
    struct zaber_port_config port;
    double pitch_mm, steps, settle_s, min_m, max_m;
    double resolution; /* 0: as the device says */
    bool home_first;
};

/* All keys, ended by NULL. */
extern const char *const stage_zaber_option_keys[];

/* The port's path belongs to the device.  0, -EINVAL. */
int stage_zaber_options_read(struct stage_zaber_options *out, const struct device *d,
                             struct error *why);

#endif
