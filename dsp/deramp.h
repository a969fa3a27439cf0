/* dsp/deramp.h -- the paper's FMCW processing (Eq. 6): mix with the emitted chirp,
 * low-pass, Fourier transform; a delay becomes a beat frequency.  Not the same as pulse
 * compression: only the part of the echo inside the emission's slot contributes.  The
 * window lies over the slot, in time. */
#ifndef ANLOS_DSP_DERAMP_H
#define ANLOS_DSP_DERAMP_H

#include <complex.h>
#include <stddef.h>

#include "dsp/chirp.h"
#include "dsp/pulse_compress.h"

struct deramp_config {
    double sample_rate_hz;
    size_t n_samples;
    struct chirp chirp;
    double latency_samples;
    enum window window;
    double gate_s[2];
    size_t n_channels;
    double rate_hz; /* of the traces, at least: 1 / range bin in two-way s */
};

struct deramp;

/* 0, -EINVAL, -ERANGE (of an echo at the gate's far end hardly anything falls into the
 * slot), -ENOMEM.  One instance a thread; create from one thread at a time. */
int deramp_create(struct deramp **out, const struct deramp_config *cfg);
void deramp_format(const struct deramp *d, struct trace_format *out);

/* rx: [n_channels][rx_stride], y: [n_channels][format.n_samples]; the same conventions as
 * pulse_compress_execute (|y| peaks at 1, carrier_hz tells the phase that was taken out).
 */
void deramp_execute(struct deramp *d, const float *rx, size_t rx_stride,
                    float complex *restrict y);
void deramp_destroy(struct deramp *d);

#endif
