/* SPDX-License-Identifier: MIT */
/* dsp/timescale.h -- compressed traces on a stretched time axis: what echoes at delay t
 * become when the air has changed and they come at t (1 + stretch), carrier and all.
 *
 * With y the baseband of an analytic signal y(t) exp(2 pi i fc t), the stretched one is
 * y(u) exp(2 pi i fc (u - t)), u = t / (1 + stretch).  It stretches each pulse as well,
 * which the air does not: an error of -66 dB at a stretch of 0.02%, -52 dB at 0.1% and
 * -43 dB at 0.3%, for a band of 2 to 20 kHz and a Hann window. */
#ifndef ANLOS_DSP_TIMESCALE_H
#define ANLOS_DSP_TIMESCALE_H

#include <stddef.h>

#include "dsp/interpolator.h"
#include "dsp/pulse_compress.h"

struct timescale;

/* Keeps the interpolator.  0, -EINVAL, -ENOMEM. */
int timescale_create(struct timescale **out, const struct trace_format *format,
                     const struct interpolator *ip);

/* Every call after this one is for this stretch, |stretch| < 0.5. */
void timescale_set(struct timescale *ts, double stretch);

/* Samples [first, end) can be made from samples of the trace alone. */
void timescale_range(const struct timescale *ts, size_t *first, size_t *end);

/* Phases exp(2 pi i fc (u - t)): [n_samples] cosines, sines, and the derivative of u by
 * the stretch in samples. */
const float *timescale_cosines(const struct timescale *ts);
const float *timescale_sines(const struct timescale *ts);
const float *timescale_slopes(const struct timescale *ts);

/* value[n] = x(u) and slope[n] = x'(u), per sample, in the range, of one real plane
 * x[n_samples] of a trace.  slope may be NULL. */
void timescale_execute(const struct timescale *ts, const float *x, float *restrict value,
                       float *restrict slope);
void timescale_destroy(struct timescale *ts);

#endif
