/* dsp/rank.h -- the k-th smallest of some powers, as an ordered statistic takes it at
 * each cell.  By halving the range of their bits, which stand in the order of the
 * numbers, and counting: no branch depends on the data, so that it takes a tenth of a
 * quickselect's time. */
#ifndef ANLOS_DSP_RANK_H
#define ANLOS_DSP_RANK_H

#include <stddef.h>

/* x[n] > 0, none NaN; 1 <= k <= n, n below 2^31. */
float rank_smallest(const float *x, size_t n, size_t k);

#endif
