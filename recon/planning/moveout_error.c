/* SPDX-License-Identifier: MIT */
#include "recon/planning/moveout_error.h"

#include <math.h>
#include <string.h>

#include "dsp/normal_equations.h"

#define UNRESOLVED 1e-6 /* of the normal matrix' largest element, or of its own */

struct normal { /* equations of the shift, and an error common to all pairs */
    double a[3][3], b[3], square, weight;
};

/* All in path: c t. */
static void add_pair(struct normal *n, const double speaker[3],
                     const double microphone[3], const double at_m[3], double weight)
{
    double midpoint[3], unit[3];
    for (int q = 0; q < 3; q++)
        midpoint[q] = 0.5 * (speaker[q] + microphone[q]);
    double r = geometry_distance(at_m, midpoint);
    for (int q = 0; q < 3; q++)
        unit[q] = r > 0.0 ? (at_m[q] - midpoint[q]) / r : 0.0;
    double path = geometry_distance(at_m, speaker) + geometry_distance(at_m, microphone);
    double offset = geometry_distance(speaker, microphone);
    double rest = sqrt(fmax(path * path - offset * offset, 0.0)) - 2.0 * r;
    for (int p = 0; p < 3; p++) {
        for (int q = 0; q < 3; q++)
            n->a[p][q] += weight * 4.0 * unit[p] * unit[q];
        n->b[p] += weight * 2.0 * unit[p] * rest;
    }
    n->square += weight * rest * rest;
    n->weight += weight;
}

/* Axes along which the pairs hardly differ in direction are left out. */
static void solve(const struct normal *n, double x[3])
{
    double a[3][3], least = UNRESOLVED * fmax(n->a[0][0], fmax(n->a[1][1], n->a[2][2]));
    memcpy(a, n->a, sizeof a);
    memcpy(x, n->b, sizeof n->b);
    for (int p = 0; p < 3; p++)
        if (a[p][p] <= least)
            a[p][p] = 0.0;
    normal_equations_solve(3, a[0], x, UNRESOLVED);
}

static void add_pairs(struct normal *n, const struct geometry *g, const float *weight,
                      const double at_m[3])
{
    size_t traces = g->n_positions * g->n_speakers * g->n_microphones;
    for (size_t q = 0; q < traces; q++) {
        double speaker[3], microphone[3];
        geometry_pair(g, q, speaker, microphone);
        add_pair(n, speaker, microphone, at_m, (double)weight[q]);
    }
}

void moveout_error(const struct geometry *g, const float *weight, const double at_m[3],
                   double centre_hz, double shift_m[3], double *rest_rad)
{
    struct normal n = {0};
    add_pairs(&n, g, weight, at_m);
    solve(&n, shift_m);
    double left = n.square;
    for (int p = 0; p < 3; p++)
        left -= shift_m[p] * n.b[p];
    *rest_rad = 2.0 * M_PI * centre_hz / g->sound_speed_m_s *
                sqrt(fmax(left, 0.0) / n.weight);
}
