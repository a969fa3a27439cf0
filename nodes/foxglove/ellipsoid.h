/* nodes/foxglove/ellipsoid.h -- the axes of a covariance. */
#ifndef ANLOS_NODES_FOXGLOVE_ELLIPSOID_H
#define ANLOS_NODES_FOXGLOVE_ELLIPSOID_H

/* c: xx xy xz yy yz zz.  axes[i]: of length 1, right-handed; deviation[i]: the standard
 * deviation along it, 0 where rounding made the variance negative.  Jacobi's rotations.
 */
void ellipsoid_axes(const double c[6], double axes[3][3], double deviation[3]);

#endif
