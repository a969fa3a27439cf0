/* recon/fk_plan.h -- inside f-k migration: sizes, wavenumbers and tables, made once. */
#ifndef ANLOS_RECON_FK_PLAN_H
#define ANLOS_RECON_FK_PLAN_H

#define FFTW_NO_Complex /* fftwf_complex is float[2], also beside <complex.h> */
#include <fftw3.h>

#include "recon/fk.h"

#define FK_TAPS      8   /* of the interpolation along frequency */
#define FK_FRACTIONS 512 /* steps of its table between two bins */

struct fk_axis {  /* one lateral axis */
    size_t n;     /* length of the transform: period / step */
    double dk;    /* rad/m */
    size_t k_max; /* largest wavenumber index used, either sign */
    size_t lines;
    float *cosine, *sine; /* [k_max + 1][lines], of k (line - origin) */
};

struct fk_scratch {        /* one a thread */
    float *rows;           /* [ny lines][n_f][4]: +kx re im, -kx re im */
    float *sums;           /* [2][n_f][4] */
    float *quads;          /* [n_f][8]: re im of ++ +- -+ -- */
    fftwf_complex *plane;  /* [2][y.n][n_kz] */
    fftwf_complex *column; /* [nz_fft] */
    fftwf_complex *line;   /* [grid nz][x.n] */
    fftwf_complex *trace;  /* [nt_fft] */
};

struct fk {
    double c;
    struct grid grid;
    struct trace_format trace;
    struct pool *pool;
    double sine_max; /* of the steepest angle used */

    size_t nt_fft;       /* of the transform over time */
    double df_hz, f0_hz; /* spectrum bin q is at f0_hz + q df_hz */
    size_t n_f;
    long first_bin;  /* bin 0 of the spectrum in FFT order, may be negative */
    double centre_s; /* time origin of the spectrum: the middle of the traces */
    double depth_m;  /* of the grid's first plane below the midpoints */

    struct fk_axis x, y;
    size_t nz_fft;
    double dkz;
    long kz_first;
    size_t n_kz;

    float *weights;      /* [FK_FRACTIONS + 1][FK_TAPS] */
    float *spectrum;     /* [x lines][y lines][n_f][2] */
    fftwf_complex *half; /* [x.n][grid ny][grid nz]: imaged in y and z, not yet in x */
    struct fk_scratch *scratch;
    fftwf_plan time_plan, y_plan, z_plan, x_plan;
};

#endif
