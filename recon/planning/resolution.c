/* SPDX-License-Identifier: MIT */
#include "recon/planning/resolution.h"

#include <math.h>

double resolution_gamma_s(const double band_hz[2])
{
    return 0.5 / (band_hz[1] - band_hz[0]);
}

double resolution_pair_m(double gamma_s, double speed_m_s, const double source_m[3],
                         const double receiver_m[3], const double scatterer_m[3],
                         int axis)
{
    double rt2 = 0.0, rr2 = 0.0;
    for (int a = 0; a < 3; a++) {
        rt2 += (source_m[a] - scatterer_m[a]) * (source_m[a] - scatterer_m[a]);
        rr2 += (receiver_m[a] - scatterer_m[a]) * (receiver_m[a] - scatterer_m[a]);
    }
    double turn = 0.0;
    if (rt2 > 0.0)
        turn += (source_m[axis] - scatterer_m[axis]) / sqrt(rt2);
    if (rr2 > 0.0)
        turn += (receiver_m[axis] - scatterer_m[axis]) / sqrt(rr2);
    return turn != 0.0 ? gamma_s * speed_m_s / fabs(turn) : INFINITY;
}

void resolution_finest_m(const struct geometry *g, double gamma_s,
                         const double scatterer_m[3], double out[3])
{
    size_t n = g->n_positions * g->n_speakers * g->n_microphones;
    for (int a = 0; a < 3; a++)
        out[a] = INFINITY;
    for (size_t t = 0; t < n; t++) {
        double s[3], m[3];
        geometry_pair(g, t, s, m);
        for (int a = 0; a < 3; a++)
            out[a] = fmin(out[a], resolution_pair_m(gamma_s, g->sound_speed_m_s, s, m,
                                                    scatterer_m, a));
    }
}
