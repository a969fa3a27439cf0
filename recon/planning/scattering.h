/* SPDX-License-Identifier: MIT */
/* recon/planning/scattering.h -- mirror or scatterer: how the arrival of the strongest
 * echo bends over co-located measurements.  Around a place (0, 0) its range is
 *
 *   r + sx x + sy y + b (x^2 + y^2) / (2 r):
 *
 * b is 1 for a point or a corner reflector (a hyperbola), and 0 for a flat mirror,
 * however tilted; parts smaller than a Fresnel zone lie between.  Lindell 2019, 3.2,
 * images the two kinds differently. */
#ifndef ANLOS_RECON_PLANNING_SCATTERING_H
#define ANLOS_RECON_PLANNING_SCATTERING_H

#include <stdbool.h>
#include <stddef.h>

struct scattering {
    double bend;    /* b, the mean over all places, weighted by power */
    double shift_m; /* how far beside the measurement the echo comes from: the mean of
                     * r |(sx, sy)| */
    double share;   /* of places where such a surface fits; 0: bend and shift_m are 0 */
};

struct scattering_config {
    size_t nx, ny;               /* measurements, evenly spaced */
    double pitch_x_m, pitch_y_m; /* of an axis with more than one */
    size_t n_ranges;
    double range_m, range_step_m; /* of sample 0, > 0; from sample to sample */
};

/* power [ny][nx][n_ranges]; scratch [2][ny][nx].  Cost: one pass over power. */
void scattering_measure(const struct scattering_config *cfg, const float *power,
                        float *scratch, struct scattering *out);

/* Mirrors that face the array: echoes that do not bend and come from straight ahead. */
bool scattering_is_specular(const struct scattering *s);

#endif
