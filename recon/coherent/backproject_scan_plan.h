/* recon/coherent/backproject_scan_plan.h -- inside back-projection of a scan: scratch of
 * the threads.  "Differences" are those of a voxel's and a stage position's x, in voxels.
 */
#ifndef ANLOS_RECON_COHERENT_BACKPROJECT_SCAN_PLAN_H
#define ANLOS_RECON_COHERENT_BACKPROJECT_SCAN_PLAN_H

#include "dsp/vector.h"
#include "recon/coherent/backprojection.h"

#define SCAN_LANES VECTOR_LANES
/* Heights and depths that are imaged together: near ones read the same samples, which
 * come from far. */
#define SCAN_ROWS_Y 4
#define SCAN_ROWS_Z 4
#define SCAN_ROWS   (SCAN_ROWS_Y * SCAN_ROWS_Z)
#define SCAN_BLOCK  16 /* differences that are summed together */
#define SCAN_CHUNK  8  /* microphones of one speaker that are summed together */
#define SCAN_SUMS   3  /* re, im, power */

struct scan_reading { /* of one pair's trace, for each difference of a block */
    const float *trace;
    int sample[SCAN_BLOCK];
    float near[2][SCAN_BLOCK]; /* weight of that sample: re, im */
    float far[2][SCAN_BLOCK];  /* of the next one */
    const float *fold;         /* [lanes] */
};

struct scan_row {
    size_t y, z;      /* in the image */
    float *delay;     /* [elements][SCAN_BLOCK] in stored samples */
    float *phasor[2]; /* [elements][SCAN_BLOCK] */
    float *block;     /* [SCAN_BLOCK][SCAN_SUMS][lanes]: of one block of differences */
    float *sum[SCAN_SUMS]; /* [stride][n_sum]: voxels of one remainder lie side by side */
};

struct scan_sweep { /* one a thread */
    size_t n_d;     /* differences */
    size_t n_sum;   /* voxels of one remainder, with the lanes' overhang on both sides */
    struct scan_row rows[SCAN_ROWS];
    struct scan_reading readings[SCAN_CHUNK];
};

struct scan {
    struct scan_sweep *sweeps; /* one a thread */
    float *fold;               /* [pair][lanes] live pairs of the trace's midpoint */
};

static inline size_t scan_elements(const struct backprojection *b)
{
    return b->geometry.n_speakers + b->geometry.n_microphones;
}

#endif
