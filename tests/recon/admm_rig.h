/* SPDX-License-Identifier: MIT */
/* tests/recon/admm_rig.h -- a small problem for ADMM: a plate, spikes and noise. */
#ifndef ANLOS_TESTS_RECON_ADMM_RIG_H
#define ANLOS_TESTS_RECON_ADMM_RIG_H

#include "recon/inverse/admm.h"
#include "tests/recon/primal_dual.h"

#define ADMM_RIG_SIZE 105 /* 5 x 3 x 7: no frequency stands for both of its signs */

/* Without weights, rho 0.1, 3000 iterations or 1e-6. */
extern const struct admm_config admm_rig_config;

/* Of the blur: no axis of it lies along one of the volume's. */
extern const double admm_rig_tilted[6];

/* The data, times a gain; data may be NULL. */
void admm_rig_data(double gain, double b[ADMM_RIG_SIZE], float data[ADMM_RIG_SIZE]);

void admm_rig_float(const double *x, size_t n, float *out);

/* The pool is for the test to destroy. */
struct admm *admm_rig_create(const struct admm_config *cfg, size_t threads,
                             struct pool **pool);

/* Solves with the tilted blur and checks that everything is finite, x >= 0. */
void admm_rig_solve(const struct admm_config *cfg, size_t threads,
                    const float b[ADMM_RIG_SIZE], float x[ADMM_RIG_SIZE],
                    struct admm_result *r);

/* x is as good as what the independent solver finds, and ADMM says how good. */
void admm_rig_expect_optimum(const struct primal_dual *p, const struct admm_result *r,
                             const float *x, double tolerance);

#endif
