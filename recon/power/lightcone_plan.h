/* recon/power/lightcone_plan.h -- inside the light-cone transform: sizes, the kernel and
 * scratch, made once. */
#ifndef ANLOS_RECON_POWER_LIGHTCONE_PLAN_H
#define ANLOS_RECON_POWER_LIGHTCONE_PLAN_H

#include <fftw3.h>

#include "dsp/lane_fft.h"
#include "recon/power/lightcone.h"
#include "recon/imaging/shares.h"

#define LIGHTCONE_COLUMNS 16 /* squared columns that are transformed together */

struct lightcone_scratch {  /* one a thread */
    float *bins;            /* [nt][nx] */
    float *cells;           /* [n_squared][nx] */
    float *columns;         /* [LIGHTCONE_COLUMNS][period] */
    fftwf_complex *numbers; /* [n_blocks * VECTOR_LANES] frequencies of a column */
    float *plane;           /* [ny][stride] points of LANE_FFT_POINT */
    float *line;            /* [y->n] points */
};

struct lightcone {
    struct lightcone_config cfg;
    size_t n_squared, period; /* cells, twice as many */
    size_t n_blocks;          /* of VECTOR_LANES frequencies of squared range */
    double first_m2, cell_m2; /* edge of cell 0, width */
    struct lane_fft *x, *y;
    size_t stride;         /* points of a row of the plane, no power of two */
    size_t half_x, half_y; /* frequencies of the kernel, which is even in x and y */

    struct shares *volume_to_cells, *cells_to_volume; /* each other's transpose, but */
    struct shares *bins_to_cells, *cells_to_bins;     /* for the inverse: these two */
    struct shares *inverse_to_cells, *inverse_to_volume;

    float *fade_x, *fade_y; /* [nx], [ny]: of the inverse's measurements */
    float *kernel;          /* [n_blocks][half_x][half_y] points */
    float *damping;  /* [n_blocks][half_x][half_y][VECTOR_LANES]: of the Wiener filter */
    float *spectrum; /* [n_blocks][ny][nx] points */
    struct lightcone_scratch *scratch;
    fftwf_plan forth, back;
};

/* The point of the spectrum of column (ix, iy) in a block. */
static inline float *lightcone_point(const struct lightcone *l, size_t block, size_t iy,
                                     size_t ix)
{
    return l->spectrum + ((block * l->cfg.ny + iy) * l->cfg.nx + ix) * LANE_FFT_POINT;
}

/* columns[which] of the thread's scratch, zero from n_squared on, to the spectrum. */
void lightcone_transform(struct lightcone *l, struct lightcone_scratch *s, size_t which,
                         size_t iy, size_t ix);

/* Fills kernel and damping; the rest is planned and allocated.  0, -ENOMEM. */
int lightcone_plan_kernel(struct lightcone *l);

#endif
