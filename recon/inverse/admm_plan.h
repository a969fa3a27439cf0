/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm_plan.h -- inside the iterations: state, and the step that involves
 * K.
 *
 * A split variable z and its scaled dual u are both read off their sum v before the
 * shrinkage: z = S(v), u = v - S(v).  Only v is stored, and with xh = a A x + (1 - a) z
 * the over-relaxed update of both is v += a (A x - S(v)). */
#ifndef ANLOS_RECON_INVERSE_ADMM_PLAN_H
#define ANLOS_RECON_INVERSE_ADMM_PLAN_H

#define FFTW_NO_Complex
#include <fftw3.h>

#include "recon/inverse/admm.h"

/* Planes are split in so many runs whatever the number of threads, so that sums add up
 * the same way. */
#define ADMM_RUNS 8

enum admm_part { ADMM_SELF, ADMM_X, ADMM_Y, ADMM_Z, ADMM_PARTS };

/* What is summed over all voxels of a split, for the stopping rule. */
struct admm_norms {
    double gap;    /* |A x - z|^2 */
    double ax, z;  /* |A x|^2, |z|^2 */
    double change; /* |A' (z - z_before)|^2 */
    double dual;   /* |A' u|^2 */
};

struct admm_scratch {      /* one a thread */
    float *rows;           /* of the split */
    float *plane;          /* [ny][nx] right-hand side, for the transform */
    fftwf_complex *column; /* [nz][row] */
};

struct admm {
    struct admm_config cfg;
    struct admm_operator linear; /* forward NULL: a blur */
    size_t n, nx, ny, nz, plane; /* plane: floats from one to the next, aligned */
    size_t parts;                /* 1, or 4 with differences */
    double rho;
    double gain;             /* |K| of the blur or operator as given; 1 inside */
    double scale;            /* of the data: all inside is in units of it */
    float kappa[2];          /* thresholds: of x, of its differences */
    float *v[2][ADMM_PARTS]; /* [nz][plane]: before, after */
    float divide;            /* of the blur's step: what its result is multiplied with */
    float *target;           /* of the blur's step: x, or a direction */
    float *x;                /* [nz][plane] */
    struct admm_norms norms[ADMM_RUNS]; /* of the runs of planes of a checked round */
    bool check;                         /* this round sums up norms */
    struct admm_scratch *scratch;

    /* blur */
    size_t row, layer;       /* frequencies of x with padding, of a plane */
    fftwf_complex *spectrum; /* [nz][layer] */
    fftwf_complex *kernel;   /* [nz][layer] K */
    fftwf_complex *data;     /* [nz][layer] K' b */
    float *power;            /* [nz][layer] |K|^2 */
    float *laplace[3];       /* 2 - 2 cos k along each axis */
    fftwf_plan plane_forth, plane_back, column_forth, column_back;

    /* operator: all in planes, [nz][plane] */
    float *rhs; /* K'b + rho A' g */
    float *kb;  /* K' b */
    float *mx;  /* (K'K + mx_rho (1 + D'D)) x */
    double mx_rho;
    float *residual, *ahead;
    struct admm_subspace *subspace;
    float *measured; /* [n_data] */
};

/* admm_blur.c */
int admm_blur_create(struct admm *a);
void admm_blur_begin(struct admm *a, const float *b); /* data <- K' b, x <- K' b */
void admm_blur_emit(struct admm *a, size_t z, size_t thread);
void admm_blur_update(struct admm *a); /* x from the emitted planes */
/* The step of an operator is preconditioned with that of a blur: power <- |F response|,
 * and spectrum of r -> target = (power + rho (1 + D'D))^-1 r. */
void admm_blur_power(struct admm *a, const float *response);
void admm_blur_precondition(struct admm *a);
double admm_blur_misfit(struct admm *a, const float *b, const float *x);
void admm_blur_destroy(struct admm *a);

/* admm_normal.c */
int admm_normal_create(struct admm *a);
void admm_normal_begin(struct admm *a, const float *b);
void admm_normal_emit(struct admm *a, size_t z, size_t thread);
void admm_normal_update(struct admm *a);
double admm_normal_misfit(struct admm *a, const float *b, const float *x);
void admm_normal_destroy(struct admm *a);
#endif
