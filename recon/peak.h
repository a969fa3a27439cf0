/* recon/peak.h -- a peak of an image between its voxels: the logarithm of the intensity
 * is a paraboloid there. */
#ifndef ANLOS_RECON_PEAK_H
#define ANLOS_RECON_PEAK_H

#include <stddef.h>

#include "recon/grid.h"

struct peak_fit {
    double position_m[3];
    double width_m[3];       /* -6 dB of the intensity */
    double covariance_m2[6]; /* xx xy xz yy yz zz: inverse curvature over the SNR
                              * (Cramer-Rao; the curvature is the intensity's, twice the
                              * amplitude's)  */
};

/* voxel: index of a local maximum of intensity; snr: its intensity over the noise's.  On
 * the rim of the grid, or where the curvature is not that of a peak, that axis stays on
 * the voxel's centre and its width is one step. */
void peak_fit(const struct grid *grid, const float *intensity, size_t voxel, double snr,
              struct peak_fit *out);

#endif
