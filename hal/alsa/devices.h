/* SPDX-License-Identifier: MIT */
/* hal/alsa/devices.h -- which PCM devices there are, and what one direction of each can
 * do by itself: nothing that alsa-lib would convert counts. */
#ifndef ANLOS_HAL_ALSA_DEVICES_H
#define ANLOS_HAL_ALSA_DEVICES_H

#include <alsa/asoundlib.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/error.h"
#include "hal/alsa/sample_format.h"

enum { ALSA_RATES = 8 };
extern const unsigned alsa_rates_hz[ALSA_RATES]; /* those in use, rising */

struct alsa_capability {
    bool formats[SAMPLE_FORMATS];
    bool mmap, rw;
    unsigned channels_min, channels_max;
    unsigned rate_min_hz, rate_max_hz;
    bool rates[ALSA_RATES];
    size_t period_min, period_max; /* frames */
    size_t buffer_min, buffer_max;
};

/* Opens for us: nothing is converted, nothing blocks.  0 or a negative errno. */
int alsa_open(snd_pcm_t **out, const char *device, bool capture);
snd_pcm_format_t alsa_format(enum sample_format f);

/* The number of the card that it belongs to; -1: to none. */
int alsa_card(snd_pcm_t *pcm);

/* Starts from all that is possible.  0 or a negative errno. */
int alsa_any(snd_pcm_t *pcm, snd_pcm_hw_params_t *params);
int alsa_capability_read(struct alsa_capability *out, snd_pcm_t *pcm);

/* "S32 S16", "44100 48000" or, with none of those in use, "8000..11025"; return out. */
char *alsa_formats_text(const struct alsa_capability *c, char *out, size_t size);
char *alsa_rates_text(const struct alsa_capability *c, char *out, size_t size);

/* "S32 S16, 1..32 channels, 44100 48000 Hz"; returns out. */
char *alsa_capability_text(const struct alsa_capability *c, char *out, size_t size);

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
