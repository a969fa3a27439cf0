/* SPDX-License-Identifier: MIT */
/* recon/coherent/fk.h -- f-k (Stolt 1978) migration of co-located traces to an image: a
 * plane wave (kx, ky) of frequency f came from depth wavenumber kz = sqrt((4 pi f / c)^2
 * - kx^2 - ky^2).
 *
 * The transform over midpoints is a direct sum at the image's own wavenumbers, so
 * midpoints may stand on any lines and the image on any grid.  Wavenumbers beyond what
 * the midpoints sample are used as well (the spectrum is tiled), up to the steepest angle
 * under which the aperture sees the image; what is finer than the grid folds onto it, so
 * that each voxel holds the value of the fine image at its centre.
 *
 * Gain: Stolt's inverse (kz) is narrow sideways, the adjoint (1) in depth; it is sqrt(kz)
 * times the power that `sharpen` asks for.  A frequency f holds what lateral wavenumbers
 * up to a limit that grows with f hold, so that low ones are in all of the band, high
 * ones in its top alone: weight on the top evens that out. */
#ifndef ANLOS_RECON_COHERENT_FK_H
#define ANLOS_RECON_COHERENT_FK_H

#include <complex.h>
#include <stdbool.h>
#include <stddef.h>

#include "dsp/pool.h"
#include "dsp/pulse_compress.h"
#include "recon/grid.h"

#define FK_MIN_SAMPLES 16 /* of a trace */

struct fk_config {
    double sound_speed_m_s;
    size_t nx, ny;           /* lines of midpoints */
    const double *x_m, *y_m; /* [nx], [ny] */
    size_t copies; /* lines of x cover the aperture so many times over; 0: once */
    /* [ny]: lines of x that have traces, first and behind the last; NULL: all.  Others of
     * a gather are not looked at. */
    const size_t (*x_range)[2];
    double plane_z_m;          /* of the midpoints */
    struct trace_format trace; /* of the co-located traces */
    double band_hz[2];
    struct grid grid; /* before the plane (z above plane_z_m) */
    double sharpen; /* exponent of the depth wavenumber over its largest: 0 as above, more
                     * for narrower points with stronger sidelobes */
    bool taper; /* the band's upper half ends softly: of traces that hold more than it */
    struct pool *pool;
};

struct fk;

/* Copies; allocates and plans all.  0, -EINVAL, -ENOMEM. */
int fk_create(struct fk **out, const struct fk_config *cfg);

/* gather [nx][ny][trace.n_samples], weight [nx][ny] multiplies each trace,
 * intensity [grid nz][ny][nx]. */
void fk_migrate(struct fk *m, const float complex *gather, const float *weight,
                float *intensity);
void fk_destroy(struct fk *m);

/* Lateral times depth wavenumbers, of one sign each: what an image costs goes by them. */
double fk_plane_waves(const struct fk *m);

#endif
