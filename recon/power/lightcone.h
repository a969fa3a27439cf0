/* SPDX-License-Identifier: MIT */
/* recon/power/lightcone.h -- the light-cone transform (O'Toole 2018; Lindell 2019 Eq. 9):
 * confocal measurements <-> a volume of isotropic scatterers,
 *
 *   tau(x', y', t) = (t c)^-n  integral rho(x, y, z) delta(r - t c / 2) dx dy dz,
 *   r^2 = (x - x')^2 + (y - y')^2 + z^2.
 *
 * With u = z^2 and v = (t c / 2)^2 this is a convolution with delta(x^2 + y^2 + u - v),
 * which is done by Fourier transforms of twice the size an axis, so that nothing wraps.
 * Voxels, time bins and cells of u and v are boxes and hand over exactly the part that
 * they share (nothing is lost or made); the kernel is the mean over a voxel's face.
 *
 * The volume stands on the lattice of the measurements.  Layouts: rho [nz][ny][nx],
 * tau [ny][nx][nt].  Cost: 2 transforms of all squared time columns, and of nx ny points
 * for each of their frequencies; 64 x 64 x 512 needs 50 MB beside the data. */
#ifndef ANLOS_RECON_POWER_LIGHTCONE_H
#define ANLOS_RECON_POWER_LIGHTCONE_H

#include <stddef.h>

#include "dsp/pool.h"

struct lightcone_config {
    size_t nx, ny;                /* measurements, 1 or more */
    double pitch_x_m, pitch_y_m;  /* between them */
    size_t nt;                    /* time bins */
    double range_m, range_step_m; /* t c / 2: middle of bin 0, and from bin to bin */
    size_t nz;                    /* 0: voxels stand where the bins do */
    double depth_m, depth_step_m; /* middle of plane 0, and from plane to plane */
    double falloff;               /* n, 0..8 */
    double snr;       /* of the Wiener filter: power ratio, over the mean gain of the
                       * kernel; > 0 */
    double taper;     /* of the inverse: part of the aperture, 0..0.5, over which the
                       * measurements fade at each rim.  0: they end sharply, which rings
                       * from the rim inwards; 0.1 lowers sidelobes by 3 dB */
    size_t n_squared; /* at least so many cells of squared range; 0: nt */
    struct pool *pool;
};

struct lightcone;

/* Plans and allocates; not while another thread plans.  0, -EINVAL, -ENOMEM. */
int lightcone_create(struct lightcone **out, const struct lightcone_config *cfg);

/* tau = A rho.  In all three the output is overwritten and may not be the input; finite
 * data below 1e30 gives finite results. */
void lightcone_forward(struct lightcone *l, const float *rho, float *tau);

/* rho = A' tau: the exact transpose of forward, not the inverse. */
void lightcone_adjoint(struct lightcone *l, const float *tau, float *rho);

/* rho from tau by the Wiener filter; negative where there is noise. */
void lightcone_inverse(struct lightcone *l, const float *tau, float *rho);
void lightcone_destroy(struct lightcone *l);

#endif
