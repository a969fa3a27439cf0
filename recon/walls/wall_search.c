/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_search.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/geometry.h"

#define BIN_M         0.02 /* of distance; two neighbours count together */
#define STEP_MOST_RAD 0.05
#define STEP_REACH_M  0.03 /* what half a step of direction does at the array's end */
#define AZIMUTH_RAD   1.2  /* to both sides of straight ahead */
#define ECHOES_MOST   2000 /* more are thinned out by whole pairs */

struct bin {
    double weight;
    unsigned count;
    uint32_t last; /* pair that counted here, from 1 */
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* (d - n.s)(d - n.m) = (path^2 - |s - m|^2) / 4, from the mirrored speaker's distance to
 * the microphone.  Negative: none. */
static double distance_of(const struct wall_echo *e, const double normal[3])
{
    double s = dot(normal, e->speaker_m), m = dot(normal, e->microphone_m);
    double direct = geometry_distance(e->speaker_m, e->microphone_m);
    double path = e->path_m + 2.0 * e->lag_s * dot(normal, e->velocity_m_s); /* nearly */
    double quarter = 0.25 * (path * path - direct * direct);
    if (quarter <= 0.0)
        return -1.0;
    return 0.5 * (s + m) + sqrt(0.25 * (s - m) * (s - m) + quarter);
}

/* A pair counts once, with the first of its echoes. */
static void count(struct bin *b, const struct wall_echo *e)
{
    if (b->last == e->pair + 1)
        return;
    b->last = e->pair + 1;
    b->weight += e->weight;
    b->count++;
}

struct best {
    double weight;
    size_t n_pairs;
    struct wall wall;
};

static void try_direction(const struct wall_search *s, const struct wall_echo *echoes,
                          size_t n, size_t stride, const double normal[3],
                          struct bin *bins, size_t n_bins, struct best *best)
{
    memset(bins, 0, n_bins * sizeof *bins);
    for (size_t i = 0; i < n; i++) {
        if (echoes[i].pair % stride)
            continue;
        double d = distance_of(&echoes[i], normal);
        if (!(d > s->reach_m[0] && d < s->reach_m[1]))
            continue;
        double at = (d - s->reach_m[0]) / BIN_M; /* window k covers k - 1 .. k + 1 */
        size_t k = (size_t)at;
        count(&bins[k], &echoes[i]);
        count(&bins[k + 1], &echoes[i]);
    }
    for (size_t k = 0; k < n_bins; k++) {
        if (bins[k].weight <= best->weight)
            continue;
        best->weight = bins[k].weight;
        best->n_pairs = bins[k].count;
        memcpy(best->wall.normal, normal, sizeof best->wall.normal);
        best->wall.distance_m = s->reach_m[0] + (double)k * BIN_M;
    }
}

int wall_search_best(const struct wall_search *s, const struct wall_echo *echoes,
                     size_t n, struct wall *out, size_t *n_pairs)
{
    double step = fmin(STEP_MOST_RAD, 2.0 * STEP_REACH_M / fmax(s->aperture_m, 1e-3));
    int wide = (int)ceil(AZIMUTH_RAD / step);
    int high = s->upright ? 0 : (int)ceil(s->tilt_rad / step);
    size_t n_bins = (size_t)((s->reach_m[1] - s->reach_m[0]) / BIN_M) + 3;
    size_t stride = 1 + n / ECHOES_MOST;
    struct best best = {.n_pairs = 0};
    struct bin *bins = calloc(n_bins, sizeof *bins);
    if (!bins)
        return -ENOMEM;
    for (int h = -high; h <= high; h++) {
        for (int k = -wide; k <= wide; k++) {
            double azimuth = AZIMUTH_RAD * k / wide;
            double tilt = high ? s->tilt_rad * h / high : 0.0;
            const double normal[3] = {sin(azimuth) * cos(tilt), sin(tilt),
                                      cos(azimuth) * cos(tilt)};
            try_direction(s, echoes, n, stride, normal, bins, n_bins, &best);
        }
    }
    free(bins);
    *out = best.wall;
    *n_pairs = best.n_pairs * stride;
    return 0;
}
