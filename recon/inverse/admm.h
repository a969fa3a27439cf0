/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm.h -- sharpen an image: the alternating direction method of
 * multipliers (Boyd 2011; Lindell 2019, 3.3) for
 *
 *   minimise 1/2 |K x - b|^2 + l1 |x|_1 + tv TV(x)   over x >= 0,
 *
 * where K blurs with a point spread function (periodically: leave room around what is
 * bright) or is any linear operator with its transpose.  x and its differences are split
 * off: the step that involves K is one product in the frequency domain, or the
 * minimum over a few directions for an operator; all others are voxel by voxel.
 *
 * Scaled form, over-relaxed (Boyd 3.4.3), with the residuals and the stopping rule of
 * Boyd 3.3, and rho balanced by residuals that are relative (Wohlberg 2017). */
#ifndef ANLOS_RECON_INVERSE_ADMM_H
#define ANLOS_RECON_INVERSE_ADMM_H

#include <stdbool.h>
#include <stddef.h>

#include "dsp/pool.h"

/* A linear operator and its exact transpose; outputs are overwritten. */
struct admm_operator {
    void *ctx;
    void (*forward)(void *ctx, const float *x, float *y); /* y [n_data] */
    void (*adjoint)(void *ctx, const float *y, float *x); /* x [n] */
    size_t n_data;
};

struct admm_config {
    size_t n[3];       /* voxels along x, y, z; arrays are [z][y][x] */
    double l1, tv;     /* weights over the reference level, >= 0 */
    bool tv_isotropic; /* lengths of gradients, not sums of differences */
    double rho;        /* to start with, > 0; in units of |K|^2 */
    double relaxation; /* 1..1.9; 0: 1.8 */
    size_t iterations; /* at most */
    double tolerance;  /* of both relative residuals */
    const struct admm_operator *linear; /* NULL: a blur, see below; copied */
    struct pool *pool;
};

struct admm_result {
    size_t iterations;
    bool converged;
    double primal, dual; /* relative residuals at the end */
    double rho;
    double objective; /* of the result, in units of the data squared; l1 and tv in it
                       * are l1_weight and tv_weight */
    double l1_weight, tv_weight;
};

struct admm;

/* Plans and allocates; not while another thread plans.  0, -EINVAL, -ENOMEM. */
int admm_create(struct admm **out, const struct admm_config *cfg);

/* The blur: a Gaussian of unit sum with this covariance in voxels^2 (xx xy xz yy yz zz,
 * positive semidefinite).  Before the first solve; may change between solves. */
void admm_blur_gaussian(struct admm *a, const double covariance[6]);

/* x [z][y][x] from b (the same shape, or [n_data]); every x is finite and >= 0 when b is
 * finite.  The weights are multiples of `reference`, in units of K' b; 0: of the largest
 * of K' b, so that the result scales with b and weights from 1 on leave nothing. */
void admm_solve(struct admm *a, const float *b, double reference, float *x,
                struct admm_result *result);
void admm_destroy(struct admm *a);

#endif
