/* SPDX-License-Identifier: MIT */
/* recon/inverse/iterative.h -- inside `--method iterative`: with base "lct", ADMM whose
 * operator is the light-cone transform, on the powers of all pairs moved out to zero
 * offset (recon/coherent/zero_offset).  The same contract as struct imager_method. */
#ifndef ANLOS_RECON_INVERSE_ITERATIVE_H
#define ANLOS_RECON_INVERSE_ITERATIVE_H

#include "recon/imaging/imager.h"
#include "recon/inverse/admm.h"

/* Of the option's rho: this operator passes less than a blur. */
#define ITERATIVE_LIGHTCONE_RHO 0.2

struct iterative_lightcone;

int iterative_lightcone_create(struct iterative_lightcone **out,
                               const struct imager_config *cfg,
                               const struct imager_options *options, const char **why);
void iterative_lightcone_add(struct iterative_lightcone *l, size_t position,
                             size_t speaker, const float complex *traces,
                             const bool *masked);
void iterative_lightcone_image(struct iterative_lightcone *l, float *intensity);
void iterative_lightcone_describe(const struct iterative_lightcone *l,
                                  struct imager_outcome *out);
void iterative_lightcone_reset(struct iterative_lightcone *l);
void iterative_lightcone_destroy(struct iterative_lightcone *l);

/* One part more of what `iterative` has done: the outcome holds for all of them. */
void iterative_join(struct imager_outcome *out, const struct admm_result *part);

/* A point comes out of the deconvolution as a voxel or two, between which nothing can
 * read where it is.  As CLEAN ends with a beam (Hogbom 1974), x [n[2]][n[1]][n[0]] is
 * spread by 1, 6 and 1 eighths along each axis, which keeps the middle of
 * all that stands beside each other. */
void iterative_beam(const size_t n[3], float *restrict x, float *restrict spare);

#endif
