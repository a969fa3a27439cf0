/* SPDX-License-Identifier: MIT */
/* dsp/deramp.h -- the paper's FMCW processing (Lindell 2019, Eq. 6): mix with the emitted
 * chirp, low-pass, Fourier transform; a delay becomes a beat frequency.
 *
 * The chirp that is mixed with runs on beyond the emission's end, so that an echo beats
 * over its whole length, whenever it comes (stretch processing, Caputi 1971).  Echoes
 * then lie staggered in time; a filter whose group delay is that of each beat's echo
 * (deskew: Carrara, Goodman, Majewski 1995, 10.2) aligns them and removes the residual
 * video phase.  From there on time is frequency, the same for all delays, and the window
 * lies over the band, as after pulse compression: over the slot it would weight lower
 * frequencies the more, the later an echo comes.
 *
 * Before mixing the microphones are equalised, and the clicks with which an emission
 * begins and ends: of a direct path as loud as the echoes -130 dB remain in the gate,
 * under a Hann window, and -60 dB of an emission that the ping cuts. */
#ifndef ANLOS_DSP_DERAMP_H
#define ANLOS_DSP_DERAMP_H

#include <complex.h>
#include <stddef.h>

#include "dsp/chirp.h"
#include "dsp/microphone.h"
#include "dsp/pulse_compress.h"

struct deramp_config {
    double sample_rate_hz;
    size_t n_samples; /* in a ping, per channel; best with the next emission whole */
    struct chirp chirp;
    double latency_samples;
    enum window window; /* over the band */
    double gate_s[2];
    size_t n_channels;
    const struct microphone *const *microphones; /* [n_channels] or NULL: flat */
    double rate_hz; /* of the traces, at least: 1 / range bin in two-way s */
};

struct deramp;

/* 0, -EINVAL, -ERANGE (of an echo at the gate's far end hardly anything falls into the
 * ping, or the chirp is far too steep for the gate), -ENOMEM.  One instance a thread;
 * create from one thread at a time. */
int deramp_create(struct deramp **out, const struct deramp_config *cfg);
void deramp_format(const struct deramp *d, struct trace_format *out);

/* The format of one of this configuration, which is not planned.  0, or -EINVAL, -ERANGE
 * as deramp_create. */
int deramp_format_of(const struct deramp_config *cfg, struct trace_format *out);

/* rx: [n_channels][rx_stride], y: [n_channels][format.n_samples]; the same conventions as
 * pulse_compress_execute.  An echo that is cut off by the ping's end loses the end of its
 * band and keeps its peak of 1. */
void deramp_execute(struct deramp *d, const float *rx, size_t rx_stride,
                    float complex *restrict y);
void deramp_destroy(struct deramp *d);

#endif
