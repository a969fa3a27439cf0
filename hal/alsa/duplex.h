/* hal/alsa/duplex.h -- playback and capture of one device, started together: playback
 * frame n and capture frame n, counted from the start, are of the same moment. */
#ifndef ANLOS_HAL_ALSA_DUPLEX_H
#define ANLOS_HAL_ALSA_DUPLEX_H

#include <stdbool.h>
#include <stdint.h>

#include "hal/alsa/stream.h"

struct alsa_duplex {
    struct alsa_stream playback, capture;
    bool linked;            /* one call starts both; else one right after the other */
    bool on_cards;          /* else nothing may pace them */
    bool one_clock;         /* they are of one card and linked */
    uint64_t played, heard; /* frames written and read since the start */
};

/* Errors are those of alsa_stream_open. */
int alsa_duplex_open(struct alsa_duplex *out, const char *device, const struct rig *rig,
                     struct complaint *why);

/* What is read and written. */
struct alsa_duplex_ends {
    /* The n playback frames from number `frame` on. */
    void (*fill)(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n);
    void (*take)(void *ctx, const struct alsa_stream *s,
                 const snd_pcm_channel_area_t *areas, size_t offset, uint64_t frame,
                 size_t n);
    void *ctx;
};

/* Fills the playback buffer and starts, both counts from 0; also after a break.  0 or a
 * negative errno. */
int alsa_duplex_start(struct alsa_duplex *d, const struct alsa_duplex_ends *ends);

/* Waits until a period is heard or stop_fd is readable, moves what there is, and fills up
 * the playback.  0, -ECANCELED (stop_fd), -ETIMEDOUT (no sound for much longer than a
 * period), -EPIPE, -ESTRPIPE, -ENODEV, other negative errno: what was heard since the
 * call before may be broken then. */
int alsa_duplex_cycle(struct alsa_duplex *d, const struct alsa_duplex_ends *ends,
                      int stop_fd);

/* After -EPIPE: which side was it?  Both may be. */
void alsa_duplex_broken(const struct alsa_duplex *d, bool *overrun, bool *underrun);
void alsa_duplex_close(struct alsa_duplex *d);

#endif
