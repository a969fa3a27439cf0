/* SPDX-License-Identifier: MIT */
/* recon/planning/resolution.h -- how close two scatterers may be and still be told apart
 * by the time of their echoes, Lindell 2019, Eq. 15:
 *
 *   dx = gamma c / ((xt - x) / rt + (xr - x) / rr)
 *
 * for a source t and a receiver r and a scatterer at x.  One pair's bound; the widths of
 * an image are those of recon/geometry.h. */
#ifndef ANLOS_RECON_PLANNING_RESOLUTION_H
#define ANLOS_RECON_PLANNING_RESOLUTION_H

#include "recon/geometry.h"

#define RESOLUTION_LIGHT_M_S 299792458.0

/* gamma of a linear sweep, 1 / (2 B), in s. */
double resolution_gamma_s(const double band_hz[2]);

/* Eq. 15 along an axis (0..2), in m, as a magnitude; infinity where a step along the axis
 * changes no path. */
double resolution_pair_m(double gamma_s, double speed_m_s, const double source_m[3],
                         const double receiver_m[3], const double scatterer_m[3],
                         int axis);

/* The finest that any pair of the geometry has, along each axis. */
void resolution_finest_m(const struct geometry *g, double gamma_s,
                         const double scatterer_m[3], double out[3]);

#endif
