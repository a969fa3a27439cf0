/* SPDX-License-Identifier: MIT */
/* dsp/band_transform.h -- a real signal to the frequencies of one band, and those back to
 * complex baseband over a part of the time: what a filter needs, and nothing beside it.
 *
 * Long transforms are cut into short ones and direct sums in vector code (struct
 * band_plan).  That takes half the time of FFTW's own transforms of those lengths,
 * batched and measured (tests/bench/bench_compress), and short ones are planned in a
 * moment. */
#ifndef ANLOS_DSP_BAND_TRANSFORM_H
#define ANLOS_DSP_BAND_TRANSFORM_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/vector.h"

struct band_transform_config {
    size_t n_min;        /* the transform is at least this long; 2^26 at most */
    double band[2];      /* cycles per sample, 0..0.5 */
    double oversampling; /* of the baseband, over the width of the band, >= 1 */
    double span;         /* time that is wanted back, in samples of the signal, < n_min */
    double beyond;       /* so much more of it is wanted, which changes nothing but
                          * n_output */
};

/* Bins are numbered [n_streams][n_bins]; some at the edges may lie outside of the band.
 */
struct band_transform_layout {
    size_t length; /* L */
    size_t n_streams, n_bins;
    size_t n_output; /* samples of the baseband that cover the span */
    double rate;     /* of the baseband, over the signal's */
    double carrier;  /* cycles per sample of the signal; is at 0 in the baseband */
};

struct band_plan;
struct band_transform;

/* Plans (from one thread at a time) and allocates.  0, -EINVAL, -ENOMEM. */
int band_transform_create(struct band_transform **out,
                          const struct band_transform_config *cfg);
void band_transform_layout(const struct band_transform *bt,
                           struct band_transform_layout *out);

/* The layout that one of this configuration would have, unplanned.  0, -EINVAL. */
int band_layout_choose(struct band_transform_layout *out,
                       const struct band_transform_config *cfg);

/* How it is cut and its tables, for band_lanes; they live as long as it does. */
const struct band_plan *band_transform_plan(const struct band_transform *bt);

/* Frequency of a bin, in cycles per sample. */
double band_transform_frequency(const struct band_transform *bt, size_t stream,
                                size_t bin);

/* Transforms x[n], n <= length; zeros follow.  The bins stay inside. */
void band_transform_forward(struct band_transform *bt, const float *x, size_t n);

/* A bin of what was transformed: sum over x[i] exp(-2 pi i frequency i). */
float complex band_transform_bin(const struct band_transform *bt, size_t stream,
                                 size_t bin);

/* y[n_output]: sum over all bins of filter * bin * exp(2 pi i (frequency - carrier) t),
 * t = i / rate.  filter: [n_streams][n_bins], 0 where there is nothing to be kept. */
void band_transform_inverse(struct band_transform *bt,
                            const float complex *restrict filter,
                            float complex *restrict y);
void band_transform_destroy(struct band_transform *bt);

/* How a transform is cut into streams, and the tables for that.
 *
 * A transform of L = R m samples is R/2 complex ones of m and a direct sum over R
 * (decimation in frequency); the way back is R of m' and a sum over R for those samples
 * that are wanted.  Frequencies are (k + 1/2) / L, so that the R streams of bins are R/2
 * conjugate pairs. */

struct band_plan {
    struct band_transform_layout layout;
    size_t n_forward, n_inverse; /* m, m': multiples of BAND_BLOCK, lane_fft's lengths */
    size_t first;                /* bin 0 of stream s is R first + s of L */
    float *roots;                /* [R/2][R]: cosines of the first half, sines */
    float *twiddle;              /* [R/2][2][m], real parts and imaginary parts */
    size_t n_table;              /* n_output rounded up to m' */
    float *step, *shift;         /* [2][n_table] */
};

/* 0, -EINVAL, -ENOMEM; on error there is nothing to clear. */
int band_plan_init(struct band_plan *p, const struct band_transform_config *cfg);
void band_plan_clear(struct band_plan *p);

/* The same forth and back for up to 16 channels at once, each in one lane of a register:
 * FFTW's own transforms of interleaved channels take three times as long as one by one,
 * these a third.  Whatever the number of channels, it costs what some 9 cost one by one.
 */
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
