/* SPDX-License-Identifier: MIT */
/* dsp/rank.h -- the k-th smallest of some numbers, and their median, without sorting them
 * all and without memory. */
#ifndef ANLOS_DSP_RANK_H
#define ANLOS_DSP_RANK_H

#include <stddef.h>

/* Of powers, as an ordered statistic takes it at each cell: x[n] >= 0, neither -0 nor
 * NaN; 1 <= k <= n, n below 2^31.  By narrowing the range of their bits, which stand in
 * the order of the numbers, and counting, in turn where it lies when they are spread
 * evenly and in the middle: no branch depends on the data, so that it takes less than a
 * tenth of a quickselect's time. */
float rank_smallest(const float *x, size_t n, size_t k);

/* Of any numbers but NaN, which it puts into another order: the k-th, 1 <= k <= n, with
 * none that is larger before it.  Hoare's FIND, 1961: n steps on average. */
double rank_double(double *x, size_t n, size_t k);

/* The mean of the middle two where n is even; NaN of none. */
double rank_median(double *x, size_t n);

#endif
