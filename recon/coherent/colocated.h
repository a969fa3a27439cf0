/* SPDX-License-Identifier: MIT */
/* recon/coherent/colocated.h -- the pairs of a scan whose speaker and microphone stand
 * (nearly) at one place, as confocal measurements of power: Lindell 2019 Eq. 8, 9. */
#ifndef ANLOS_RECON_COHERENT_COLOCATED_H
#define ANLOS_RECON_COHERENT_COLOCATED_H

#include "recon/imaging/imager.h"

struct colocated;

struct colocated_lattice { /* where the measurements stand */
    size_t nx, ny, n_ranges;
    double x_m, y_m, pitch_x_m, pitch_y_m; /* of the first; between them, > 0 */
    double plane_z_m;
    double range_m, range_step_m; /* of zero-offset echoes: t c / 2 */
};

/* Picks the pairs with the smallest offset of all.  Their midpoints must be a lattice of
 * even pitch.  0, -ENOTSUP (*why says what is missing), -EINVAL, -ENOMEM. */
int colocated_create(struct colocated **out, const struct imager_config *cfg,
                     const char **why);
void colocated_lattice(const struct colocated *c, struct colocated_lattice *out);

/* As imager_add.  Echoes are put where those of zero offset would be; |trace|^2 times the
 * squared range, so that a point's power fades as 1 / r^2. */
void colocated_add(struct colocated *c, size_t position, size_t speaker,
                   const float complex *traces, const bool *masked);

/* power [ny][nx][n_ranges]: the mean of all pairs at a place; 0 where none was heard. */
void colocated_power(const struct colocated *c, float *power);
void colocated_reset(struct colocated *c);
void colocated_destroy(struct colocated *c);

#endif
