/* SPDX-License-Identifier: MIT */
#include "recon/planning/psf_tilt.h"

#include "dsp/normal_equations.h"
#include "recon/hann.h"

#define UNRESOLVED 1e-9 /* of the variance in depth */

struct directions { /* sums over pairs, which `weight` divides */
    double mean[3], product[3][3], weight;
};

static void add_pair(struct directions *d, const double s[3], const double m[3],
                     const double at_m[3], double weight)
{
    double u[3], rs = geometry_distance(at_m, s), rm = geometry_distance(at_m, m);
    for (int a = 0; a < 3; a++) {
        u[a] = (rs > 0.0 ? (at_m[a] - s[a]) / rs : 0.0) +
               (rm > 0.0 ? (at_m[a] - m[a]) / rm : 0.0);
        d->mean[a] += weight * u[a];
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            d->product[a][b] += weight * u[a] * u[b];
    d->weight += weight;
}

static void add_pairs(struct directions *d, const struct geometry *g, const float *weight,
                      const double at_m[3])
{
    size_t n = g->n_positions * g->n_speakers * g->n_microphones;
    for (size_t t = 0; t < n; t++) {
        double s[3], m[3];
        geometry_pair(g, t, s, m);
        add_pair(d, s, m, at_m, (double)weight[t]);
    }
}

void psf_tilt(const struct geometry *g, const float *weight, const double band_hz[2],
              const double at_m[3], double tilt[2])
{
    struct directions d = {0};
    double c[3][3], middle_hz = 0.5 * (band_hz[0] + band_hz[1]);
    double width_hz = band_hz[1] - band_hz[0];
    double f2 = middle_hz * middle_hz, spread2 = HANN_VARIANCE * width_hz * width_hz;
    add_pairs(&d, g, weight, at_m);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
            c[a][b] = (f2 + spread2) * d.product[a][b] / d.weight -
                      f2 * d.mean[a] * d.mean[b] / (d.weight * d.weight);
    double across[4] = {c[0][0], c[0][1], c[1][0], c[1][1]};
    tilt[0] = -c[0][2];
    tilt[1] = -c[1][2];
    for (int a = 0; a < 2; a++)
        if (!(across[3 * a] > UNRESOLVED * c[2][2]))
            across[3 * a] = 0.0;
    normal_equations_solve(2, across, tilt, UNRESOLVED);
}
