/* SPDX-License-Identifier: MIT */
/* recon/coherent/backprojection.h -- inside `--method backprojection`: each voxel sums
 * every pair's trace at its own two-way delay, phase kept, each pair weighted by 1 /
 * (pairs that share its midpoint).  Traces are stored finer than they come, so that
 * linear interpolation does (recon/coherent/fine_trace.h): -50 dB of double precision in
 * all.
 *
 * The coherence factor (Mallart and Fink 1994, "Adaptive focusing in scattering media
 * through sound-speed inhomogeneities") of a voxel is what its pairs add up to over what
 * they would, were all in phase: |sum w x|^2 / (sum w  sum w |x|^2), with the pairs'
 * weights w.  The intensity is multiplied by its power `coherence`. */
#ifndef ANLOS_RECON_COHERENT_BACKPROJECTION_H
#define ANLOS_RECON_COHERENT_BACKPROJECTION_H

#include <complex.h>
#include <stdbool.h>
#include <stdint.h>

#include "recon/coherent/fine_trace.h"
#include "recon/imaging/imager.h"

struct backprojection {
    struct geometry geometry;
    struct grid grid;
    struct pool *pool;
    double plane_z_m;             /* depth counts from here: the middle of the array */
    double centre_m[3], spread_m; /* of pings with places of their own: mean, rms */
    float coherence;              /* exponent; 0: off */

    struct fine_trace fine;
    float complex *added; /* [position][pair][fine.in.n_samples] as they came */

    /* Stored samples, fine.n_stored of a trace.  A scan's lie in groups of `lanes`,
     * [pair][n_stored][re, im][lanes] with the stage positions in the lanes, each trace
     * over the live pairs of its midpoint.  Otherwise they are packed in words,
     * [position][pair][n_stored]. */
    bool scan;
    size_t lanes;
    float *traces;
    uint32_t *words;
    float *unit; /* [position][pair] */

    uint32_t *cell; /* [position][pair]: number of its midpoint */
    size_t n_cells, n_live_cells;
    bool *live;            /* [position][pair]: added, not masked */
    uint32_t *fold;        /* [n_cells]: live pairs of each midpoint */
    uint32_t *stored_fold; /* [position][pair]: that of its midpoint, 0 if not live, when
                              it was stored; STORE_STALE: what is stored is old */
    void *scratch;         /* of the imaging part */
    float *image;          /* where imager_image wants it */

    size_t stride;  /* scan: voxels between two stage positions */
    double first_m; /* scan: x of stage position 0 */
};

#define STORE_STALE UINT32_MAX

static inline size_t backprojection_pairs(const struct backprojection *b)
{
    return b->geometry.n_speakers * b->geometry.n_microphones;
}

/* Of a scan: a stored sample of a pair at all positions, [re, im][lanes]. */
static inline float *backprojection_sample(const struct backprojection *b, size_t pair,
                                           size_t sample)
{
    return b->traces + (pair * b->fine.n_stored + sample) * 2 * b->lanes;
}

/* Traces as they came to stored ones: only what is not up to date.  create: 0 or -ENOMEM.
 */
int backproject_store_create(struct backprojection *b, const struct trace_format *in,
                             double band_hz, double gate_s);
void backproject_store(struct backprojection *b);
void backproject_store_destroy(struct backprojection *b);

/* What stands for the depth of a voxel: its distance from the array's plane, or, where
 * pings have places of their own and there is no plane, the rms distance from them. */
float backprojection_depth_m(const struct backprojection *b, float x_m, float y_m,
                             float z_m);

/* Of the sum of all stored traces, and of the sum of their fold * |x|^2, which counts if
 * coherence does.  Depth makes up for spreading, once: echoes of a point fade faster, of
 * a plate slower. */
float backprojection_intensity(const struct backprojection *b, float depth_m, float re,
                               float im, float power);

/* The way through all voxels, for any geometry (recon/coherent/backproject_any) and for
 * an array that a stage carries along x in steps of whole voxels
 * (recon/coherent/backproject_scan), several times as fast.  create: 0 or -ENOMEM. */
int backproject_any_create(struct backprojection *b);
void backproject_any(struct backprojection *b);
void backproject_any_destroy(struct backprojection *b);

/* Does the geometry fit?  Sets stride and first_m. */
bool backproject_scan_fits(struct backprojection *b);
int backproject_scan_create(struct backprojection *b);
void backproject_scan(struct backprojection *b);
void backproject_scan_destroy(struct backprojection *b);

#endif
