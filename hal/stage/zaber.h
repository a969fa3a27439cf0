/* SPDX-License-Identifier: MIT */
/* hal/stage/zaber.h -- a Zaber stage (the paper's: X-BLQ-E) on a serial line, protocol
 * ASCII 2.  The device keeps the place, the speed and the limits; what is read of it are
 * the resolution, how far it reaches and, unless it is told, how fast it goes.  One that
 * moves, because who drove it was killed, is stopped first.  It is named by
 *
 *   zaber:TTY?pitch_mm=TRAVEL
 *
 * pitch_mm is needed: the travel of a turn of the motor, from the data sheet.  The rest
 * has defaults: steps=200 (full steps of a turn), resolution (microsteps of a full step,
 * of the device), device=1, axis=1, baud=115200, timeout=0.3, checksum=auto, on or off,
 * settle, min, max, speed (set at the start; default: as the device has it),
 * homing=first-move or manual.  Metres and seconds. */
#ifndef ANLOS_HAL_STAGE_ZABER_H
#define ANLOS_HAL_STAGE_ZABER_H

#include <stdbool.h>

#include "dsp/error.h"
#include "hal/device.h"

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

struct stage_zaber_options {
    struct zaber_port_config port;
    double pitch_mm, steps, settle_s, min_m, max_m;
    double resolution; /* 0: as the device says */
    double speed_m_s;  /* its own; 0: as the device has it */
    bool home_first;
};

/* All keys, ended by NULL. */
extern const char *const stage_zaber_option_keys[];

/* The port's path belongs to the device.  0, -EINVAL. */
int stage_zaber_options_read(struct stage_zaber_options *out, const struct device *d,
                             struct error *why);

#endif
