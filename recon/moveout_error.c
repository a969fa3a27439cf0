#include "recon/moveout_error.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "recon/fold.h"

#define UNRESOLVED 1e-6 /* of the normal matrix' largest element */

struct normal { /* equations of the shift, and an error common to all pairs */
    double a[3][3], b[3], square, weight;
};

static double distance(const double a[3], const double b[3], double unit[3])
{
    double d[3], r = 0.0;
    for (int q = 0; q < 3; q++) {
        d[q] = a[q] - b[q];
        r += d[q] * d[q];
    }
    r = sqrt(r);
    for (int q = 0; unit && q < 3; q++)
        unit[q] = r > 0.0 ? d[q] / r : 0.0;
    return r;
}

/* All in path: c t. */
static void add_pair(struct normal *n, const double speaker[3],
                     const double microphone[3], const double at_m[3], double weight)
{
    double midpoint[3], unit[3];
    for (int q = 0; q < 3; q++)
        midpoint[q] = 0.5 * (speaker[q] + microphone[q]);
    double path = distance(at_m, speaker, NULL) + distance(at_m, microphone, NULL);
    double offset = distance(speaker, microphone, NULL);
    double moved = sqrt(fmax(path * path - offset * offset, 0.0));
    double rest = moved - 2.0 * distance(at_m, midpoint, unit);
    for (int p = 0; p < 3; p++) {
        for (int q = 0; q < 3; q++)
            n->a[p][q] += weight * 4.0 * unit[p] * unit[q];
        n->b[p] += weight * 2.0 * unit[p] * rest;
    }
    n->square += weight * rest * rest;
    n->weight += weight;
}

static void swap_rows(struct normal *n, int p, int q)
{
    for (int i = 0; i < 3; i++) {
        double t = n->a[p][i];
        n->a[p][i] = n->a[q][i];
        n->a[q][i] = t;
    }
    double t = n->b[p];
    n->b[p] = n->b[q];
    n->b[q] = t;
}

/* Elimination, axes without extent left out. */
static void solve(struct normal n, double x[3])
{
    double least = UNRESOLVED * fmax(n.a[0][0], fmax(n.a[1][1], n.a[2][2]));
    for (int p = 0; p < 3; p++) {
        int best = p;
        for (int r = p + 1; r < 3; r++)
            if (fabs(n.a[r][p]) > fabs(n.a[best][p]))
                best = r;
        swap_rows(&n, p, best);
        if (fabs(n.a[p][p]) <= least) {
            n.a[p][p] = INFINITY;
            continue;
        }
        for (int r = p + 1; r < 3; r++) {
            double f = n.a[r][p] / n.a[p][p];
            for (int q = p; q < 3; q++)
                n.a[r][q] -= f * n.a[p][q];
            n.b[r] -= f * n.b[p];
        }
    }
    for (int p = 2; p >= 0; p--) {
        x[p] = n.b[p];
        for (int q = p + 1; q < 3; q++)
            x[p] -= n.a[p][q] * x[q];
        x[p] = isinf(n.a[p][p]) ? 0.0 : x[p] / n.a[p][p];
    }
}

static void add_pairs(struct normal *n, const struct geometry *g, const double at_m[3],
                      const uint32_t *cell, const uint32_t *fold)
{
    size_t pairs = g->n_speakers * g->n_microphones;
    for (size_t q = 0; q < g->n_positions * pairs; q++) {
        double speaker[3], microphone[3];
        geometry_speaker(g, q / pairs, q % pairs / g->n_microphones, speaker);
        geometry_microphone(g, q / pairs, q % g->n_microphones, microphone);
        add_pair(n, speaker, microphone, at_m, 1.0 / (double)fold[cell[q]]);
    }
}

int moveout_error(const struct geometry *g, const double at_m[3], double centre_hz,
                  double shift_m[3], double *rest_rad)
{
    struct normal n = {0};
    size_t n_traces = g->n_positions * g->n_speakers * g->n_microphones, n_cells;
    uint32_t *cell = malloc(n_traces * sizeof *cell);
    uint32_t *fold = calloc(n_traces, sizeof *fold);
    int err = cell && fold ? fold_number(g, cell, &n_cells) : -ENOMEM;
    if (!err) {
        for (size_t q = 0; q < n_traces; q++)
            fold[cell[q]]++;
        add_pairs(&n, g, at_m, cell, fold);
        solve(n, shift_m);
        double left = n.square;
        for (int p = 0; p < 3; p++)
            left -= shift_m[p] * n.b[p];
        *rest_rad = 2.0 * M_PI * centre_hz / g->sound_speed_m_s *
                    sqrt(fmax(left, 0.0) / n.weight);
    }
    free(cell);
    free(fold);
    return err;
}
