/* SPDX-License-Identifier: MIT */
/* dsp/arrival.h -- when sound came, how loud and with what sign: the peaks of compressed
 * traces (dsp/pulse_compress.h), between samples.
 *
 * The time is that of the envelope's peak, by a parabola through the logarithm of three
 * samples of it: with a Hann window and an oversampling of 8 its error is under a
 * hundredth of a sample of a signal whose band is 3/8 of its rate.  Another arrival that
 * overlaps pulls at it; 2 / band after the first one it is clear of it.
 */
#ifndef ANLOS_DSP_ARRIVAL_H
#define ANLOS_DSP_ARRIVAL_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/pulse_compress.h"

struct arrival {
    double time_s;       /* delay */
    double complex peak; /* of the analytic signal: 1 for a gain of 1, -1 inverted */
};

/* The strongest peak of y[n_samples] at delays of from_s to to_s.  false: there is none,
 * as of a trace that is all 0 there, or the trace still rises at both ends. */
bool arrival_strongest(const struct trace_format *f, const float complex *y,
                       double from_s, double to_s, struct arrival *out);

/* The first peak whose amplitude is `least` or more.  Between a pulse and its sidelobes
 * (Hann: -31 dB) that has to tell the difference. */
bool arrival_first(const struct trace_format *f, const float complex *y, double from_s,
                   double to_s, double least, struct arrival *out);

/* The highest power of a sample of y[n_samples] at delays of from_s to to_s; 0: there is
 * none. */
double arrival_power(const struct trace_format *f, const float complex *y, double from_s,
                     double to_s);

/* Median amplitude of the whole trace: noise and reverberation, as long as arrivals are
 * sparse.  scratch [n_samples]. */
double arrival_floor(const struct trace_format *f, const float complex *y,
                     float *scratch);

#endif
