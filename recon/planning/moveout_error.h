/* SPDX-License-Identifier: MIT */
/* recon/planning/moveout_error.h -- what moveout without dip costs (`--method fast`): it
 * moves an echo of a pair with half-offset h to t0 = sqrt(t^2 - (2h/c)^2), which is the
 * time of a co-located pair at the midpoint only for what lies straight ahead.  At
 * distance r and an angle a from there the path is short by about h^2 sin(a)^2 / r; here
 * it is taken exactly. */
#ifndef ANLOS_RECON_PLANNING_MOVEOUT_ERROR_H
#define ANLOS_RECON_PLANNING_MOVEOUT_ERROR_H

#include "recon/geometry.h"

#define MOVEOUT_FALLS_APART 0.8 /* rad; beyond it the image of a point does */

/* shift_m: by how much a point at at_m is imaged beside itself (least squares over all
 * pairs, of which those of one midpoint count as one; 0 along axes that are not
 * resolved).  rest_rad: rms phase at centre_hz that the shift does not take up
 * (MOVEOUT_FALLS_APART).  weight: recon/imaging/fold.h. */
void moveout_error(const struct geometry *g, const float *weight, const double at_m[3],
                   double centre_hz, double shift_m[3], double *rest_rad);

#endif
