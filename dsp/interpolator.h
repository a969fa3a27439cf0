/* SPDX-License-Identifier: MIT */
/* dsp/interpolator.h -- the 8-tap interpolator of least mean square error for signals
 * that fill a given part of the sampled band evenly (Oetken, Parks and Schuessler 1975),
 * and its slope, tabulated over the fraction of a sample.
 *
 * The mean square error at worst is -70 dB when half of the band is filled, -63 dB at
 * 0.55; traces have little at their band's edges, where most of it arises. */
#ifndef ANLOS_DSP_INTERPOLATOR_H
#define ANLOS_DSP_INTERPOLATOR_H

#include <stddef.h>

#define INTERPOLATOR_TAPS   8
#define INTERPOLATOR_BEFORE 3 /* taps before the sample at or below the point */

struct interpolator;

/* occupancy: width of the signal's band over the sampling rate, 0.05..0.9.
 * 0, -EINVAL, -ENOMEM. */
int interpolator_create(struct interpolator **out, double occupancy);

/* Weights of samples -3..4 around a point `fraction` (0..1) past sample 0, and after them
 * those of the derivative, per sample: out[2 * INTERPOLATOR_TAPS]. */
void interpolator_weights(const struct interpolator *ip, double fraction, float *out);
void interpolator_destroy(struct interpolator *ip);

#endif
