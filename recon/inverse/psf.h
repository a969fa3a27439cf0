/* SPDX-License-Identifier: MIT */
/* recon/inverse/psf.h -- the point spread function: how wide, and how turned, the image
 * of a point is.  A Gaussian is fitted to the image of a small corner reflector (Lindell
 * 2019, 3.3) or to the image that the geometry alone gives a point. */
#ifndef ANLOS_RECON_INVERSE_PSF_H
#define ANLOS_RECON_INVERSE_PSF_H

#include <stdbool.h>

#include "recon/geometry.h"
#include "recon/grid.h"

struct psf { /* amplitude = sqrt(peak) exp(-1/2 d' C^-1 d), d = position - centre */
    double centre_m[3];
    double covariance_m2[6]; /* C: xx xy xz yy yz zz */
    double peak;             /* intensity */
    double residual;         /* rms of the amplitude over its peak, where it was fitted */
    size_t n_voxels;         /* of the fit */
};

/* Fits around a bright voxel where the amplitude is above PSF_FIT_LEVEL of that voxel's:
 * moments first, then Gauss-Newton (Levenberg 1944) on the amplitude in double precision.
 * intensity [nz][ny][nx].  An axis of one voxel is not fitted: its variance is 0.
 * 0, -EINVAL (no such voxel, or nothing there), -ERANGE (the grid is too coarse or the
 * place not a peak: the fit has no curvature, or its top lies beyond what was fitted),
 * -ENOMEM. */
#define PSF_FIT_LEVEL 0.35
int psf_fit(struct psf *out, const struct grid *grid, const float *intensity,
            size_t voxel);

/* Inverse of a symmetric matrix (xx xy xz yy yz zz); false: not positive definite, or no
 * more than rounding makes it. */
bool psf_invert(const double m[6], double out[6]);

/* -6 dB widths of the intensity, widest first, and the unit vectors they lie along. */
void psf_axes(const struct psf *p, double width_m[3], double axes[3][3]);

/* -6 dB widths along x, y and z through the centre. */
void psf_widths(const struct psf *p, double width_m[3]);

struct psf_config { /* a point that all pairs see, each midpoint counted once */
    const struct geometry *geometry;
    double band_hz[2]; /* Hann-windowed */
    double at_m[3];
    size_t n_pairs;          /* at most so many are summed, spread evenly; 0: all */
    bool (*stop)(void *ctx); /* asked by psf_compute before each voxel; NULL: nobody is */
    void *stop_ctx;
};

/* In closed form: exp(-1/2 d' C^-1 d) with the curvature that the amplitude has at the
 * point, which is the covariance of the wave vectors that the pairs send and hear.  A few
 * percent wider than a fit, and cheap.  0, -ERANGE (an axis is not resolved), -ENOMEM. */
int psf_curvature(const struct psf_config *cfg, double covariance_m2[6]);

/* The fit to the point's image, all pairs summed with their phase in double precision, on
 * a grid made for it.  *grid and *intensity ([nz][ny][nx], 1 at the point; free it) may
 * be NULL.  0, -ERANGE (fewer than two axes are resolved), -ENOMEM, -ECANCELED (stop). */
int psf_compute(struct psf *out, const struct psf_config *cfg, struct grid *grid,
                float **intensity);

#endif
