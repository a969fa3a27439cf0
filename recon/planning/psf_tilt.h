/* SPDX-License-Identifier: MIT */
/* recon/planning/psf_tilt.h -- how the image of a point leans.  Its intensity falls
 * around the point d as exp(-d' C d), where C is the covariance of the wavenumbers k = 2
 * pi f / c (sum of the unit vectors to both elements) over band and pairs, of which those
 * of one midpoint count as one (the spread of a wave packet).  Echoes of what stands
 * aside come at a slant, and so a plane of voxels that misses the point by dz in depth
 * has its maximum beside it. */
#ifndef ANLOS_RECON_PLANNING_PSF_TILT_H
#define ANLOS_RECON_PLANNING_PSF_TILT_H

#include "recon/geometry.h"

/* tilt: by how much the maximum lies beside the point along x and y, over how much the
 * plane lies behind it; 0 along axes that are not resolved.  Hann's window over the band.
 * weight: recon/imaging/fold.h. */
void psf_tilt(const struct geometry *g, const float *weight, const double band_hz[2],
              const double at_m[3], double tilt[2]);

#endif
