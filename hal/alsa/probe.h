/* hal/alsa/probe.h -- what a PCM device is good for as an array. */
#ifndef ANLOS_HAL_ALSA_PROBE_H
#define ANLOS_HAL_ALSA_PROBE_H

#include <stdbool.h>

#include "hal/alsa/capability.h"
#include "dsp/complaint.h"

struct alsa_probe {
    bool has_playback, has_capture;
    struct alsa_capability playback, capture;
    bool one_clock;
    char clock_reason[160]; /* how that was decided */
};

/* 0, -ENOENT (no such device; the complaint names those that exist), -EBUSY, other
 * negative errno. */
int alsa_probe(struct alsa_probe *out, const char *device, struct complaint *why);

#endif
