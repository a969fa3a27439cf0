/* SPDX-License-Identifier: MIT */
/* recon/inverse/iterative.h -- what of `--method iterative` is tested and measured by
 * itself. */
#ifndef ANLOS_RECON_INVERSE_ITERATIVE_H
#define ANLOS_RECON_INVERSE_ITERATIVE_H

#include <stddef.h>

/* Of the option's rho, with base "lct": this operator passes less than a blur. */
#define ITERATIVE_LIGHTCONE_RHO 0.2

/* A point comes out of the deconvolution as a voxel or two, between which nothing can
 * read where it is.  As CLEAN ends with a beam (Hogbom 1974), x [n[2]][n[1]][n[0]] is
 * spread by 1, 6 and 1 eighths along each axis, which keeps the middle of
 * all that stands beside each other. */
void iterative_beam(const size_t n[3], float *restrict x, float *restrict spare);

#endif
