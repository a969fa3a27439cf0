/* hal/alsa/devices.h -- which PCM devices there are. */
#ifndef ANLOS_HAL_ALSA_DEVICES_H
#define ANLOS_HAL_ALSA_DEVICES_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/complaint.h"

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
int alsa_devices_complain(const char *device, bool capture, struct complaint *why);

#endif
