/* SPDX-License-Identifier: MIT */
/* recon/coherent/dmo.h -- dip moveout in log-stretched time, and stack over offsets (Zhou
 * 1996; Lindell 2019, Eq. 13 and 14).
 *
 * After normal moveout and t -> ln t, an event of a pair with half-offset h moves to
 * where a co-located pair would have recorded it when its spectrum over midpoint (k) and
 * log time (W) is multiplied by exp(-i phi),
 *   phi = W/2 (A - 1 - ln((A + 1) / 2)),   A = sqrt(1 + (2 k h / W)^2).
 * That is one axis of midpoints.  Two axes are done one after the other, k h = kx hx and
 * then ky hy: what this leaves out, 4 hx hy nx ny / (c^2 t) in time for a plane with
 * normal n, has opposite signs for a pair and the one with speaker and microphone
 * swapped in y, and cancels in their stack.
 *
 * The phase is applied over midpoints as the convolution that it stands for, without
 * wrapping: an array has few midpoints, and pairs of one offset lie on every second of
 * them. */
#ifndef ANLOS_RECON_COHERENT_DMO_H
#define ANLOS_RECON_COHERENT_DMO_H

#include <stddef.h>
#include <stdint.h>

#include "dsp/pool.h"

/* phi in rad for k h in rad, W in rad; W 0: its limit |k h|; W infinite: 0.  Odd in W,
 * even in k h, without cancellation: relative error a few 1e-16 for 2 k h / W from 0 to
 * infinity. */
double dmo_phase(double kh, double w);

struct dmo_config {
    size_t n_lines; /* of midpoints, evenly spaced */
    double pitch_m;
    size_t n_offsets;
    const double *half_offset_m; /* [n_offsets], >= 0 */
    size_t n_inputs;
    const uint32_t *offset, *line; /* [n_inputs]: what each input is a trace of */
    size_t n_bins;
    const double *w;   /* [n_bins]: angular log-frequency, rad; at 0 the operator is real:
                        * the mean of both signs */
    struct pool *pool; /* used by dmo_create */
};

struct dmo;

/* Tables of n_bins * n_offsets * 2 n_lines complex numbers.  0, -EINVAL, -ENOMEM. */
int dmo_create(struct dmo **out, const struct dmo_config *cfg);

/* out [n_lines][out_stride] = the stack of in [n_inputs][in_stride], spectra of one bin
 * of 16 midpoints in the other axis: 16 re, 16 im.  Reads only from d: threads may share
 * it. */
void dmo_stack(const struct dmo *d, size_t bin, const float *restrict in,
               size_t in_stride, float *restrict out, size_t out_stride);
void dmo_destroy(struct dmo *d);

#endif
