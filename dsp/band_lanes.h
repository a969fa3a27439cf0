/* dsp/band_lanes.h -- what dsp/band_transform does, forth and back, for up to 16 channels
 * at once, each in one lane of a register: FFTW's own transforms of interleaved channels
 * take three times as long as one by one, these a third.  Whatever the number of
 * channels, it costs what some 9 cost one by one. */
#ifndef ANLOS_DSP_BAND_LANES_H
#define ANLOS_DSP_BAND_LANES_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/band_plan.h"
#include "dsp/vector.h"

#define BAND_LANES_POINT (2 * VECTOR_LANES) /* floats: real parts, imaginary parts */

struct band_lanes;

/* plan: must outlive it.  One instance a thread: it owns scratch.  0, -ENOMEM. */
int band_lanes_create(struct band_lanes **out, const struct band_plan *plan);

/* Lane's part of a filter [n_streams][n_bins][re, im][16]. */
void band_lanes_filter(const struct band_plan *plan, float *filter, size_t lane,
                       const float complex *of_lane);

/* From x, rows of n <= length samples, stride apart, to y, rows of n_output; n_channels
 * of 1..16 rows.  As band_transform_forward and band_transform_inverse.  shared: the
 * filter is that of one channel, [n_streams][n_bins][re, im], for all. */
void band_lanes_execute(struct band_lanes *bl, const float *x, size_t x_stride, size_t n,
                        const float *filter, bool shared, float complex *restrict y,
                        size_t n_channels);
void band_lanes_destroy(struct band_lanes *bl);

#endif
