/* SPDX-License-Identifier: MIT */
/* recon/power/shares.h -- conservative resampling of one axis: what each interval of
 * one set shares with each of another, as a sparse matrix with a band of neighbours a
 * row. */
#ifndef ANLOS_RECON_POWER_SHARES_H
#define ANLOS_RECON_POWER_SHARES_H

#include <stddef.h>
#include <stdint.h>

struct shares {
    size_t n_out, n_in;
    uint32_t *first, *start; /* [n_out]: first input, [n_out + 1]: its weight's place */
    float *weight;           /* [start[n_out]] */
};

/* Rising edges out[n_out + 1] and in[n_in + 1].  Weight [o][i] is the length of what
 * interval o and interval i share, times out_gain[o] and in_gain[i].  0, -ENOMEM. */
int shares_create(struct shares **out, const double *out_edges, size_t n_out,
                  const double *in_edges, size_t n_in, const double *out_gain,
                  const double *in_gain);

/* The exact transpose.  0, -ENOMEM. */
int shares_transpose(struct shares **out, const struct shares *s);

/* y [n_out][width] = shares * x [n_in][in_stride]; width of the vectors side by side. */
void shares_apply(const struct shares *s, const float *x, size_t in_stride, size_t width,
                  float *restrict y, size_t out_stride);
void shares_destroy(struct shares *s);

#endif
