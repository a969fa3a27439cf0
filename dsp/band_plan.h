/* dsp/band_plan.h -- how dsp/band_transform and dsp/band_lanes cut a transform into
 * streams, and the tables that both read.
 *
 * A transform of L = R m samples is R/2 complex ones of m and a direct sum over R
 * (decimation in frequency); the way back is R of m' and a sum over R for those samples
 * that are wanted.  Frequencies are (k + 1/2) / L, so that the R streams of bins are R/2
 * conjugate pairs. */
#ifndef ANLOS_DSP_BAND_PLAN_H
#define ANLOS_DSP_BAND_PLAN_H

#include <stddef.h>

#include "dsp/band_transform.h"

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

#endif
