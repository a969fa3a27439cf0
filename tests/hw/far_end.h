/* SPDX-License-Identifier: MIT */
/* tests/hw/far_end.h -- the other end of a snd-aloop cable: a thread that hears what is
 * played on hw:Loopback,0,N and answers what is recorded there, frame by frame, with a
 * delay that stays the same while nothing breaks.  Uses ALSA directly, none of our own.
 */
#ifndef ANLOS_TESTS_HW_FAR_END_H
#define ANLOS_TESTS_HW_FAR_END_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <alsa/asoundlib.h>

struct far_end_config {
    unsigned substream; /* N */
    snd_pcm_format_t format;
    unsigned n_channels, rate_hz;
    size_t buffer_frames;
    size_t ahead_frames; /* of answers over what is heard: the delay, to a period or so */
    /* heard: n frames, all channels interleaved, from number `frame` on; answer: n frames
     * to be written, silence before.  Called by the thread. */
    void (*answer)(void *ctx, uint64_t frame, const void *heard, void *answer, size_t n);
    void *ctx;
};

struct far_end;

/* Opens both directions and starts; aborts the program when that is not possible. */
struct far_end *far_end_start(const struct far_end_config *cfg);

/* Did a frame get lost on this end? */
bool far_end_broke(const struct far_end *f);

void far_end_stop(struct far_end *f);

#endif
