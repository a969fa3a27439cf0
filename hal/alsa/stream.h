/* SPDX-License-Identifier: MIT */
/* hal/alsa/stream.h -- one direction of a PCM device, set to an exact rate and a format
 * and channel count that the device has by itself; mapped or by read and write. */
#ifndef ANLOS_HAL_ALSA_STREAM_H
#define ANLOS_HAL_ALSA_STREAM_H

#include <stdbool.h>
#include <stddef.h>

#include <alsa/asoundlib.h>

#include "dsp/error.h"
#include "hal/alsa/sample_format.h"
#include "hal/survey/rig_file.h"

struct alsa_stream {
    snd_pcm_t *pcm; /* NULL: closed */
    bool capture, mapped;
    enum sample_format format;
    size_t n_channels;
    unsigned rate_hz;
    size_t period, buffer;                     /* frames */
    unsigned char *interleaved;                /* [buffer][n_channels]; NULL: mapped */
    snd_pcm_channel_area_t *interleaved_areas; /* [n_channels] of it */
};

/* The least number of channels that the device has and the rig needs.  0, -ENOENT (no
 * such device; the error names those that exist), -EBUSY, -EINVAL (the device has not
 * what the rig asks for; the error says what it has), other negative errno. */
int alsa_stream_open(struct alsa_stream *out, const char *device, bool capture,
                     const struct rig *rig, struct error *why);

/* n frames from `offset` on in the areas [n_channels], to be read or written. */
typedef void alsa_frames_fn(void *ctx, const snd_pcm_channel_area_t *areas, size_t offset,
                            size_t n);

/* Hands at most n of the frames available to fn, and returns how many were moved.  To
 * playback fn may have to hand the last ones again.  Negative errno: -EPIPE (the stream
 * broke), -ENODEV (unplugged) and others. */
long alsa_stream_move(struct alsa_stream *s, size_t n, alsa_frames_fn *fn, void *ctx);
void alsa_stream_close(struct alsa_stream *s);

#endif
