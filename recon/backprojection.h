/* recon/backprojection.h -- inside `--method backprojection`: each voxel sums every
 * pair's trace at its own two-way delay, phase kept, each pair weighted by 1 / (pairs
 * that share its midpoint).  Traces are stored finer than they come, so that linear
 * interpolation does
 * (-41 dB at 4 times the band width). */
#ifndef ANLOS_RECON_BACKPROJECTION_H
#define ANLOS_RECON_BACKPROJECTION_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "recon/imager.h"

struct backprojection {
    struct geometry geometry;
    struct trace_format in;
    struct grid grid;
    struct pool *pool;
    size_t upsampling;
    size_t n_stored; /* samples of a stored trace; its first and its last two are 0 */
    double rate_hz;
    double plane_z_m;             /* depth counts from here: the middle of the array */
    double centre_m[3], spread_m; /* of pings with places of their own: mean, rms */
    size_t muted;                 /* stored samples before the gate */
    double *fine;                 /* interpolation weights of the stored rate */

    /* Traces lie in groups of `lanes`: [group][n_stored][re, im][lanes].  A scan's group
     * is a pair and its lanes the stage positions; otherwise each trace is a group of
     * one. */
    bool scan;
    size_t lanes, n_groups;
    float *traces;

    uint32_t *cell; /* [position][pair]: number of its midpoint */
    size_t n_cells;
    bool *live;     /* [position][pair]: added, not masked */
    float *weight;  /* [position][pair]: already multiplied into the traces */
    uint32_t *fold; /* [n_cells]: live pairs of each midpoint */
    void *scratch;  /* of the imaging part */
    float *image;   /* where imager_image wants it */

    size_t stride;  /* scan: voxels between two stage positions */
    double first_m; /* scan: x of stage position 0 */
};

static inline size_t backprojection_pairs(const struct backprojection *b)
{
    return b->geometry.n_speakers * b->geometry.n_microphones;
}

/* One sample of a stored trace; its imaginary part lies `lanes` further on. */
static inline float *backprojection_sample(const struct backprojection *b,
                                           size_t position, size_t pair, size_t sample)
{
    size_t group = b->scan ? pair : position * backprojection_pairs(b) + pair;
    size_t lane = b->scan ? position : 0;
    return b->traces + (group * b->n_stored + sample) * 2 * b->lanes + lane;
}

/* What stands for the depth of a voxel: its distance from the array's plane, or, where
 * pings have places of their own and there is no plane, the rms distance from them. */
static inline float backprojection_depth_m(const struct backprojection *b, float x_m,
                                           float y_m, float z_m)
{
    if (!b->geometry.pings_m)
        return z_m - (float)b->plane_z_m;
    float dx = x_m - (float)b->centre_m[0], dy = y_m - (float)b->centre_m[1];
    float dz = z_m - (float)b->centre_m[2], spread = (float)b->spread_m;
    return sqrtf(dx * dx + dy * dy + dz * dz + spread * spread);
}

/* Depth makes up for spreading, once: echoes of a point fade faster, of a plate slower.
 */
static inline float backprojection_intensity(float depth_m, float re, float im)
{
    return depth_m * depth_m * (re * re + im * im);
}

/* The way through all voxels, for any geometry (recon/backproject_any) and for an array
 * that a stage carries along x in steps of whole voxels (recon/backproject_scan), several
 * times as fast.  create: 0 or -ENOMEM. */
int backproject_any_create(struct backprojection *b);
void backproject_any(struct backprojection *b);
void backproject_any_destroy(struct backprojection *b);

/* Does the geometry fit?  Sets stride and first_m. */
bool backproject_scan_fits(struct backprojection *b);
int backproject_scan_create(struct backprojection *b);
void backproject_scan(struct backprojection *b);
void backproject_scan_destroy(struct backprojection *b);

#endif
