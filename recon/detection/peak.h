/* SPDX-License-Identifier: MIT */
/* recon/detection/peak.h -- a peak of an image between its voxels: the logarithm of the
 * intensity is a paraboloid there.  What the image does not tell of a place is said to be
 * unknown.
 */
#ifndef ANLOS_RECON_DETECTION_PEAK_H
#define ANLOS_RECON_DETECTION_PEAK_H

#include <stdbool.h>
#include <stddef.h>

#include "recon/grid.h"

/* Standard deviation along a direction of which the image tells nothing: farther than any
 * volume, and a number that every filter and rotation stands. */
#define PEAK_UNKNOWN_M 100.0

/* Of struct peak_fit's at_border: the low (far 0) or high (far 1) end of an axis. */
#define PEAK_BORDER(axis, far) (1u << (2 * (axis) + (far)))

struct peak_fit {
    double position_m[3];
    double width_m[3];       /* -6 dB of the intensity */
    double covariance_m2[6]; /* xx xy xz yy yz zz: inverse curvature over the SNR
                              * (Cramer-Rao; the curvature is the intensity's, twice the
                              * amplitude's) */
    unsigned at_border; /* PEAK_BORDER: what is seen may be the flank of something that
                         * lies beyond */
};

enum peak_zero {                    /* what an intensity of 0 says */
                 PEAK_ZERO_EMPTY,   /* nothing is there: an image without noise */
                 PEAK_ZERO_CLIPPED, /* less than nothing is there; but where all is 0 to
                                     * the end of the grid, nothing was imaged */
                 PEAK_ZERO_UNSEEN,  /* nothing was imaged there */
};

/* voxel: index of a local maximum of intensity; snr: its intensity over the noise's.
 * body_m: of what is about as bright around the voxel, the length along each axis; NULL:
 * not known.
 *
 * Where the grid, or what was imaged of it, ends at the voxel along an axis, that axis
 * stays on the voxel's centre, has PEAK_UNKNOWN_M for its standard deviation and a border
 * for each such end; the other axes are known as well as the image is sharp, however high
 * its snr: a flank or a sidelobe of what lies beyond is bright beside its place, too.  So
 * the axis is, without a border, where it has one voxel.  Along a
 * direction in which the paraboloid is wider than three grids the place is anywhere in
 * the body, or unknown: a ridge is known across, not along.  Widths are the grid's length
 * at most.  An axis with an empty voxel beside it that is no border is known to a voxel.
 * The
 * place is the top of the logarithm's paraboloid, the covariance that of its curvature;
 * where the next voxels are 30 dB fainter or more, of the amplitude's. */
void peak_fit(const struct grid *grid, const float *intensity, size_t voxel, double snr,
              enum peak_zero zero, const double body_m[3], struct peak_fit *out);

#endif
