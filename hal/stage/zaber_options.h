/* hal/stage/zaber_options.h -- what a zaber: stage is named by:
 *
 *   zaber:TTY?pitch_mm=TRAVEL
 *
 * pitch_mm is needed: the travel of a turn of the motor, from the data sheet.  The rest
 * has defaults: steps=200 (full steps of a turn), resolution (microsteps of a full step,
 * of the device), device=1, axis=1, baud=115200, timeout=0.3, checksum=auto, on or off,
 * settle, min, max, homing=first-move or manual.  Metres and seconds. */
#ifndef ANLOS_HAL_STAGE_ZABER_OPTIONS_H
#define ANLOS_HAL_STAGE_ZABER_OPTIONS_H

#include "hal/device.h"
#include "hal/stage/zaber_port.h"

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
                             struct complaint *why);

#endif
