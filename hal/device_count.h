/* SPDX-License-Identifier: MIT */
/* hal/device_count.h -- what a device counts of what befell it and was recovered from:
 * overruns, retries, restarts of a bus.  Every node's health carries its device's. */
#ifndef ANLOS_HAL_DEVICE_COUNT_H
#define ANLOS_HAL_DEVICE_COUNT_H

#include <stdint.h>

enum { DEVICE_MAX_COUNTS = 40 };

struct device_count {
    const char *name; /* "overruns"; lives as long as the device */
    uint64_t value;   /* since the device was opened */
};

#endif
