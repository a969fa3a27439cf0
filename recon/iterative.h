/* recon/iterative.h -- inside `--method iterative`: with base "lct", ADMM whose operator
 * is the light-cone transform, on the powers of all pairs moved out to zero offset
 * (recon/zero_offset).  The same contract as struct imager_method. */
#ifndef ANLOS_RECON_ITERATIVE_H
#define ANLOS_RECON_ITERATIVE_H

#include "recon/imager.h"

struct iterative_lightcone;

int iterative_lightcone_create(struct iterative_lightcone **out,
                               const struct imager_config *cfg,
                               const struct imager_options *options, const char **why);
void iterative_lightcone_add(struct iterative_lightcone *l, size_t position,
                             size_t speaker, const float complex *traces,
                             const bool *masked);
void iterative_lightcone_image(struct iterative_lightcone *l, float *intensity);
void iterative_lightcone_reset(struct iterative_lightcone *l);
void iterative_lightcone_destroy(struct iterative_lightcone *l);

#endif
