/* SPDX-License-Identifier: MIT */
/* recon/planning/probe.h -- what a scene is like, from its traces, before much is spent
 * on its image: a coarse image of all pairs, the objects in it, the depths that can hold
 * any, whether they mirror or scatter, and how well the pairs agree. */
#ifndef ANLOS_RECON_PLANNING_PROBE_H
#define ANLOS_RECON_PLANNING_PROBE_H

#include "recon/detection/detect.h"
#include "recon/grid.h"
#include "recon/planning/coherence.h"
#include "recon/planning/scattering.h"

enum { PROBE_OBJECTS = 16, PROBE_FEWER = 2 };

struct probe_object {
    double position_m[3]; /* as imaged */
    double level_db;      /* above the image's noise */
    double extent_m;      /* the larger of width and height; 0: a point */
    double noise_m[3];    /* standard deviation of its position from noise: Cramer-Rao */
    double moveout_m[3]; /* where moveout without dip (`fast`) images it, or its edge that
                          * is farther aside, beside itself */
    double moveout_rad;  /* phase, rms over the pairs, that this leaves */
    double fewer_m[PROBE_FEWER][2]; /* what comes to moveout_m when every second speaker
                                     * is used, every fourth: they stand less evenly */
    double width_m[3];              /* of a point there */
    double tilt[2];                 /* psf_tilt */
};

struct probe {
    bool imaged; /* the coarse image was possible: midpoints on a lattice, grid before it
                  */
    bool uneven; /* dip moveout is not: lines of midpoints are not evenly spaced */
    double snr_db; /* of the strongest object; 0: nothing there */
    size_t n_objects;
    struct probe_object objects[PROBE_OBJECTS]; /* strongest first */
    struct probe_object typical; /* what may stand in this image: n_objects 0 */
    double depth_m[2]; /* z of the first and last plane that can hold a reported object */
    struct coherence coherence;   /* element_m NAN when not measurable */
    struct scattering scattering; /* share 0 when not measurable */
    bool specular;                /* mirrors that face the array */
};

/* Nothing was looked at: all of the grid may hold something, and as an example a point
 * stands half way to its edge in x and y, in the middle of its depth.  0, -ENOMEM. */
int probe_assume(struct probe *out, const struct trace_set *set, const struct grid *grid);

/* grid: of the image that is wanted.  known: what was measured of these traces before, or
 * NULL.  0, -EINVAL, -ENOMEM, -ECANCELED (the pool has stopped). */
int probe_run(struct probe *out, const struct trace_set *set, const struct grid *grid,
              const struct coherence *known, struct pool *pool);

/* Only whether things mirror or scatter, which takes less.  0, -EINVAL, -ENOMEM. */
int probe_scattering(struct probe *out, const struct trace_set *set,
                     const struct grid *grid, struct pool *pool);

/* How the image of a point leans.  Its intensity falls around the point d as
 * exp(-d' C d), where C is the covariance of the wavenumbers k = 2 pi f / c (sum of the
 * unit vectors to both elements) over band and pairs, of which those of one midpoint
 * count as one (the spread of a wave packet).  Echoes of what stands aside come at a
 * slant, and so a plane of voxels that misses the point by dz in depth has its maximum
 * beside it.
 *
 * tilt: by how much the maximum lies beside the point along x and y, over how much the
 * plane lies behind it; 0 along axes that are not resolved.  Hann's window over the band.
 * weight: recon/imaging/fold.h. */
void psf_tilt(const struct geometry *g, const float *weight, const double band_hz[2],
              const double at_m[3], double tilt[2]);

#endif
