/* SPDX-License-Identifier: MIT */
/* recon/inverse/symmetric.h -- eigenvalues and axes of a symmetric 3 x 3 matrix: of a
 * covariance, of the curvature of a peak.  Jacobi's rotations (1846). */
#ifndef ANLOS_RECON_INVERSE_SYMMETRIC_H
#define ANLOS_RECON_INVERSE_SYMMETRIC_H

/* m: xx xy xz yy yz zz.  value[i], largest first, belongs to axes[i], which have length 1
 * and are right-handed.  Rounding may make a value that is zero negative. */
void symmetric_axes(const double m[6], double value[3], double axes[3][3]);

#endif
