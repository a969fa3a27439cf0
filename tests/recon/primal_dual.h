/* SPDX-License-Identifier: MIT */
/* tests/recon/primal_dual.h -- minimise 1/2 |K x - b|^2 + l1 |x|_1 + tv TV(x) over x >= 0
 * in double precision, sharing nothing with recon/: Chambolle and Pock 2011 on dense
 * matrices, K row by row, D as index pairs. */
#ifndef ANLOS_TESTS_RECON_PRIMAL_DUAL_H
#define ANLOS_TESTS_RECON_PRIMAL_DUAL_H

#include <stdbool.h>
#include <stddef.h>

#define PRIMAL_DUAL_MAX 128

struct primal_dual {
    size_t n[3], size, n_data; /* both at most PRIMAL_DUAL_MAX */
    double *k;                 /* [n_data][size] */
    const double *b;
    bool wrap, isotropic; /* wrap: behind the last voxel comes the first; else no edge */
    double l1, tv;
};

/* y = K x, and x = K' y */
void primal_dual_forward(const struct primal_dual *p, const double *x, double *y);
void primal_dual_adjoint(const struct primal_dual *p, const double *y, double *x);
double primal_dual_objective(const struct primal_dual *p, const double *x);
void primal_dual_solve(const struct primal_dual *p, size_t iterations, double *x);

/* k = a periodic Gaussian blur of unit sum, from the sum over its frequencies; covariance
 * in voxels^2, xx xy xz yy yz zz. */
void primal_dual_blur(struct primal_dual *p, const double covariance[6]);

#endif
