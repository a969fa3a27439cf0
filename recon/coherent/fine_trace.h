/* SPDX-License-Identifier: MIT */
/* recon/coherent/fine_trace.h -- traces at a finer rate than they come at, so that linear
 * interpolation reads them with -50 dB of error.
 *
 * Linear interpolation between samples low-passes by sinc(f / rate)^2, on average over
 * the places between: by 1 - w^2 / 12, w in rad a sample.  Subtracting a twelfth of the
 * second difference beforehand makes up for it, and leaves 0.41 of the error. */
#ifndef ANLOS_RECON_COHERENT_FINE_TRACE_H
#define ANLOS_RECON_COHERENT_FINE_TRACE_H

#include <complex.h>
#include <stdint.h>

#include "dsp/pulse_compress.h"

struct fine_trace {
    struct trace_format in;
    size_t upsampling, n_threads;
    size_t n_stored; /* of a fine trace; its first sample and its last two are 0 */
    double rate_hz;
    size_t muted;             /* fine samples before the gate */
    float *weights;           /* of the interpolation */
    struct fine_scratch *own; /* [n_threads] */
};

/* What comes before gate_s, a two-way delay, is muted.  0, -ENOMEM; fine_trace_clear in
 * either case. */
int fine_trace_create(struct fine_trace *f, const struct trace_format *in, double band_hz,
                      double gate_s, size_t n_threads);
void fine_trace_clear(struct fine_trace *f);

/* in[in.n_samples] to out[re, im][upsampling][in.n_samples], the thread's own until its
 * next one. */
void fine_trace_refine(const struct fine_trace *f, size_t thread, const float complex *in,
                       const float *out[2]);

/* The same packed in words: the real part in the upper half, both in units of the trace's
 * own, which is returned.  One load reads two samples, and looking samples up is loads.
 * Fine sample q of out[n_stored] stands at input sample (q - 1) / upsampling; out's first
 * and last two words stay as they are, 0. */
float fine_trace_words(const struct fine_trace *f, size_t thread, const float complex *in,
                       uint32_t *out);

#endif
