/* SPDX-License-Identifier: MIT */
/* recon/coherent/fk_plan.h -- inside f-k migration: sizes, wavenumbers and tables, made
 * once. */
#ifndef ANLOS_RECON_COHERENT_FK_PLAN_H
#define ANLOS_RECON_COHERENT_FK_PLAN_H

#define FFTW_NO_Complex /* fftwf_complex is float[2], also beside <complex.h> */
#include <fftw3.h>

#include "recon/coherent/fk.h"

#define FK_TAPS      8   /* of the interpolation along frequency */
#define FK_FRACTIONS 512 /* steps of its table between two bins */

#define FK_BLOCK   32 /* floats that are summed over all lines before the next */
#define FK_X_BLOCK (FK_BLOCK / 2) /* frequencies of a block: re im */
#define FK_Y_BLOCK (FK_BLOCK / 4) /* +kx re im, -kx re im */
#define FK_GROUP   4 /* wavenumbers that are summed while a block is in the cache */

struct fk_axis {  /* one lateral axis */
    size_t n;     /* length of the transform: period / step */
    double dk;    /* rad/m */
    size_t k_max; /* largest wavenumber index used, either sign */
    size_t kept;  /* of the transform's wavenumbers those that hold any, of either sign */
    size_t lines;
    float *cosine, *sine; /* [k_max + 1][lines], of k (line - origin) */
};

struct fk_wave {      /* +-kx */
    size_t kx, fold;  /* fold: |kx| of the image's transform */
    size_t first_bin; /* of the spectrum that it needs */
};

struct fk_scratch {                /* one a thread */
    struct fk_wave *waves;         /* [x.k_max + 1] */
    float *rows;                   /* [FK_GROUP][n_f / FK_Y_BLOCK][y lines][FK_BLOCK] */
    float *quads;                  /* [FK_GROUP][n_f][8]: re im of ++ +- -+ -- */
    int *bin, *fraction;           /* [n_kz] of Stolt's map */
    float *phase_re, *phase_im;    /* [n_kz] */
    fftwf_complex *plane;          /* [2][y.n][n_kz] */
    fftwf_complex *plane_image;    /* [y.n][n_kz]: in y */
    fftwf_complex *column;         /* [nz_fft] */
    fftwf_complex *column_image;   /* [nz_fft]: in z */
    fftwf_complex *line;           /* [grid nz][x.n], 0 where none is kept */
    fftwf_complex *line_image;     /* [x.n]: in x */
    fftwf_complex *trace;          /* [nt_fft] */
    fftwf_complex *trace_spectrum; /* [nt_fft] */
};

struct fk {
    double c;
    struct grid grid;
    struct trace_format trace;
    struct pool *pool;
    double sine_max; /* of the steepest angle used */

    size_t nt_fft;       /* of the transform over time */
    double df_hz, f0_hz; /* spectrum bin q is at f0_hz + q df_hz */
    size_t n_f;          /* a multiple of FK_X_BLOCK */
    long first_bin;      /* bin 0 of the spectrum in FFT order, may be negative */
    double centre_s;     /* time origin of the spectrum: the middle of the traces */
    double far_m;        /* range of the traces' end */
    double depth_m;      /* of the grid's first plane below the midpoints */

    struct fk_axis x, y;
    size_t folds;         /* that a thread takes at a time */
    size_t (*x_range)[2]; /* [y lines]: of each the lines of x that have traces */
    size_t nz_fft;
    double dkz;
    long kz_first;
    size_t n_kz;
    float scale; /* of amplitudes */

    float *centring;     /* [n_f][2]: phase that moves the origin of time to centre_s */
    float *gain;         /* [n_kz] */
    float *weights;      /* [FK_FRACTIONS][FK_TAPS] */
    float *spectrum;     /* [n_f / FK_X_BLOCK][y lines][x lines][FK_BLOCK] */
    fftwf_complex *half; /* [x.kept][grid ny][grid nz]: imaged in y and z, not in x */
    struct fk_scratch *scratch;
    fftwf_plan time_plan, y_plan, z_plan, x_plan;
};

#endif
