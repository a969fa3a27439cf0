/* SPDX-License-Identifier: MIT */
/* dsp/pulse_compress.h -- correlate each channel with the emitted replica, so that an
 * echo's energy collapses onto its round-trip delay: matched filter (Turin 1960),
 * whitened over the band and windowed, to complex traces inside a gate.
 *
 * Traces are complex baseband at a rate just above the band: sample n belongs to delay
 * t0_s + n / rate_hz, and the analytic signal there is y[n] exp(2 pi i carrier_hz t). */
#ifndef ANLOS_DSP_PULSE_COMPRESS_H
#define ANLOS_DSP_PULSE_COMPRESS_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/chirp.h"
#include "dsp/microphone.h"
#include "dsp/window.h"

struct pulse_compress_config {
    double sample_rate_hz;
    size_t n_samples; /* in a ping, per channel; at least a chirp */
    struct chirp chirp;
    double latency_samples; /* from sample 0 of a ping to the emission, fractions too */
    double band_hz[2];      /* 0, 0: the chirp's */
    enum window window;     /* over the band */
    double gate_s[2]; /* two-way delays wanted; what lies before gate_s[0] is muted */
    double reach_s; /* 0; or the traces begin at the emission, no later than the first of
                     * the gate, and reach this far: pulse_compress_whole */
    double oversampling; /* trace rate over band width, >= 1; 2 suits interpolation */
    size_t n_channels;
    const struct microphone *const *microphones; /* [n_channels] or NULL: flat */
    size_t n_replica; /* 0: the chirp; else replica[n_replica] is correlated with */
    const float *replica;
};

struct trace_format {
    double t0_s, rate_hz, carrier_hz;
    size_t n_samples;
};

struct pulse_compress;

/* Plans and allocates.  One instance a thread: it owns scratch; create from one thread at
 * a time (FFTW's planner).
 * 0, -EINVAL, -ERANGE (the gate lies beyond the ping, or reach_s beyond what the gate's
 * transform holds), -ENOMEM. */
int pulse_compress_create(struct pulse_compress **out,
                          const struct pulse_compress_config *cfg);

void pulse_compress_format(const struct pulse_compress *pc, struct trace_format *out);

/* The format of one of this configuration, which is not planned: whoever takes its traces
 * knows it by that.  0, or -EINVAL, -ERANGE as pulse_compress_create. */
int pulse_compress_format_of(const struct pulse_compress_config *cfg,
                             struct trace_format *out);

/* Of all that is written.  Samples `first` and on of it, as many as of the format above,
 * are those of the gate at the same delays; without reach_s all of it is. */
void pulse_compress_whole(const struct pulse_compress *pc, struct trace_format *out,
                          size_t *first);

/* rx: [n_channels][rx_stride >= n_samples], y: [n_channels][whole.n_samples].
 * Finite input below 1e30 gives finite output.  An echo in the gate whose chirp the ping
 * holds whole peaks at |y| = 1 for a gain of 1, with phase 0 in the analytic signal; one
 * that is cut off by the ping's end loses that part of its band.  Linear: a background
 * may be subtracted before or after. */
void pulse_compress_execute(struct pulse_compress *pc, const float *rx, size_t rx_stride,
                            float complex *restrict y);
void pulse_compress_destroy(struct pulse_compress *pc);

#endif
