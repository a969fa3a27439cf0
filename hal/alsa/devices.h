/* SPDX-License-Identifier: MIT */
/* hal/alsa/devices.h -- which PCM devices there are. */
#ifndef ANLOS_HAL_ALSA_DEVICES_H
#define ANLOS_HAL_ALSA_DEVICES_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "hal/alsa/capability.h"

struct alsa_device {
    char name[128];        /* what to open: "hw:CARD=Loopback,DEV=0" */
    char description[192]; /* one line */
    bool playback, capture;
    bool is_card; /* a card's own; else a plugin of the configuration */
};

/* The cards' first, then the plugins that the configuration names.  free(*out).  0,
 * -ENOMEM, other negative errno. */
int alsa_devices_list(struct alsa_device **out, size_t *n);

/* "hw:9: playback: no such device; there are ..." and -ENOENT. */
int alsa_devices_error_say(const char *device, bool capture, struct error *why);

/* What a PCM device is good for as an array. */

struct alsa_probe {
    bool has_playback, has_capture;
    struct alsa_capability playback, capture;
    bool one_clock;
    char clock_reason[160]; /* how that was decided */
};

/* 0, -ENOENT (no such device; the error names those that exist), -EBUSY, other
 * negative errno. */
int alsa_probe(struct alsa_probe *out, const char *device, struct error *why);

#endif
