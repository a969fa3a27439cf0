/* SPDX-License-Identifier: MIT */
/* recon/power/incoherent.h -- inside `--method incoherent`: back-projection of power, for
 * arrays whose elements stand where nobody knows to better than a wavelength.
 *
 * Each trace is squared, multiplied by its squared range and filtered by the negative
 * second derivative of a Gaussian, as in filtered back-projection of spherical means
 * (Xu and Wang 2005: over a plane of measurements the second derivative undoes the blur):
 * what each echo smears over the voxels that it could come from cancels where they do
 * not agree.  Each voxel sums all traces at its delay, a midpoint counting once however
 * many pairs share it; what stays below 0 is none.  The Gaussian is as wide as positions
 * may be wrong.  Mirrors are imaged in another way: see incoherent.c. */
#ifndef ANLOS_RECON_POWER_INCOHERENT_H
#define ANLOS_RECON_POWER_INCOHERENT_H

#include <stdbool.h>
#include <stdint.h>

#include "recon/imaging/imager.h"
#include "recon/imaging/resample.h"

struct incoherent {
    struct geometry geometry;
    struct trace_format in;
    struct grid grid; /* of the image */
    struct pool *pool;
    size_t first;  /* samples of a trace before the gate */
    float *gain;   /* [in.n_samples]: squared range, faded in and out; 0 first */
    float *filter; /* [INCOHERENT_FINE][taps] */
    size_t n_taps;
    float *power;   /* [n_traces][in.n_samples], as added */
    bool *live;     /* [n_traces]: added, not masked */
    uint32_t *cell; /* [n_traces]: its midpoint */
    uint32_t *fold; /* [n_cells]: live traces of it */
    size_t n_cells;

    /* Filtered traces, INCOHERENT_FINE samples for each of the input, lie in groups of
     * `lanes`: [group][n_stored][lanes].  Of an array that a stage carries along x in
     * steps of whole voxels a group is a pair and its lanes the stage positions; else
     * each trace is a group. */
    bool scan;
    size_t lanes, n_groups, n_stored; /* the first sample and the last two are 0 */
    float *stored;
    float **scratch; /* [threads][in.n_samples + taps][lanes] */
    void *sweeps;    /* of the imaging part */

    struct incoherent_mirror *mirror; /* NULL: cannot be told */
    struct incoherent_slab *slabs;
    size_t n_slabs;
    float *coarse; /* image of one slab */

    const struct incoherent_slab *slab; /* being imaged */
    float *image;                       /* to here, negative values too */
};

/* Some depths of the image.  Power changes slowly sideways, the more so the farther away:
 * it is imaged on fewer voxels and interpolated. */
struct incoherent_slab {
    struct grid grid;
    size_t first_plane, n_planes; /* of the image */
    struct resample *resample;    /* NULL: grid is the image's own */
    size_t stride;                /* scan: voxels between two stage positions */
};

#define INCOHERENT_FINE 2

static inline size_t incoherent_pairs(const struct incoherent *b)
{
    return b->geometry.n_speakers * b->geometry.n_microphones;
}

static inline double incoherent_rate_hz(const struct incoherent *b)
{
    return b->in.rate_hz * INCOHERENT_FINE;
}

/* Voxels that back-projection of power goes through for such an image, in all slabs;
 * *scan: by the fast way of an array on a stage. */
double incoherent_voxels(const struct geometry *g, const struct grid *image, bool *scan);

/* The way through all voxels of a slab for a scan (recon/power/incoherent_scan.c).  Does
 * the geometry fit the slab?  Sets its stride. */
bool incoherent_scan_fits(const struct incoherent *b, struct incoherent_slab *slab);

/* 0, -ENOMEM; what there is then is still to be destroyed. */
int incoherent_scan_create(struct incoherent *b);
void incoherent_scan(struct incoherent *b);
void incoherent_scan_destroy(struct incoherent *b);

#endif
