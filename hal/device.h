/* SPDX-License-Identifier: MIT */
/* hal/device.h -- the name of a device, "scheme:path?key=value&key=value", and what it
 * counts. */
#ifndef ANLOS_HAL_DEVICE_H
#define ANLOS_HAL_DEVICE_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/error.h"

enum { DEVICE_MAX_OPTIONS = 24 };

/* What follows the scheme, cut into pieces. */
struct device {
    char *path; /* may be empty */
    size_t n_options;
    struct {
        const char *key, *value;
    } options[DEVICE_MAX_OPTIONS];
    char *text; /* what the pieces point into */
};

/* Points behind "scheme:", or returns NULL when the URI has another scheme. */
const char *device_arg(const char *uri, const char *scheme);

/* arg: the URI after its scheme; known: the option keys that the backend has, ended by
 * NULL; NULL: any.  Clear the result.  0, -EINVAL (an unknown key, a key without value),
 * -ENOMEM. */
int device_parse(struct device *out, const char *arg, const char *const *known,
                 struct error *why);

/* The option's value, or NULL. */
const char *device_option(const struct device *d, const char *key);

/* Reads a number within min..max; *value stays when the option is absent.  0, -EINVAL. */
int device_number(const struct device *d, const char *key, double min, double max,
                  double *value, struct error *why);

/* The index of the option's value in the words (ended by NULL), or 0 when it is absent.
 * -EINVAL when it is none of them. */
int device_choice(const struct device *d, const char *key, const char *const *words,
                  struct error *why);
void device_clear(struct device *d);

enum { DEVICE_MAX_COUNTS = 40 };

/* What befell it and was recovered from: overruns, retries, restarts of a bus.  Every
 * node's health carries its device's. */
struct device_count {
    const char *name; /* "overruns"; lives as long as the device */
    uint64_t value;   /* since the device was opened */
};

#endif
