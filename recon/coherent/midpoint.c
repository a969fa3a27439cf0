/* SPDX-License-Identifier: MIT */
#include "recon/coherent/midpoint.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "recon/imaging/fold.h"

#define SAME_M    1e-3 /* coordinates closer than this are one line */
#define MAX_CELLS 262144

static int check_plane(const struct geometry *g, const char **why)
{
    double z = g->speakers_m[0][2];
    bool plane = fabs(g->stage_axis[2]) <= SAME_M;
    for (size_t j = 0; j < g->n_speakers; j++)
        plane = plane && fabs(g->speakers_m[j][2] - z) <= SAME_M;
    for (size_t i = 0; i < g->n_microphones; i++)
        plane = plane && fabs(g->microphones_m[i][2] - z) <= SAME_M;
    if (plane)
        return 0;
    *why = "speakers and microphones in one plane z = constant";
    return -ENOTSUP;
}

static double coordinate(const struct geometry *g, size_t k, size_t pair, int axis)
{
    size_t j = pair / g->n_microphones, i = pair % g->n_microphones;
    return 0.5 * (g->speakers_m[j][axis] + g->microphones_m[i][axis]) +
           g->stage_axis[axis] * g->stage_positions_m[k];
}

/* The lines of one axis, and each pair's place on them. */
static int sort_axis(const struct geometry *g, size_t n_pairs, int axis, double **lines,
                     size_t *n_lines, uint32_t **places)
{
    size_t n = g->n_positions * n_pairs;
    *lines = malloc(n * sizeof **lines);
    *places = malloc(n * sizeof **places);
    if (!*lines || !*places)
        return -ENOMEM;
    for (size_t q = 0; q < n; q++)
        (*lines)[q] = coordinate(g, q / n_pairs, q % n_pairs, axis);
    *n_lines = lines_merge(*lines, n, SAME_M);
    for (size_t q = 0; q < n; q++)
        (*places)[q] = lines_nearest(*lines, *n_lines,
                                     coordinate(g, q / n_pairs, q % n_pairs, axis));
    return 0;
}

/* Of a stage that stands the lines are all there are. */
static int add_places(struct midpoints *m, const struct geometry *g, const char **why)
{
    size_t n_lines = m->nx, n = g->n_positions * m->n_pairs;
    m->n_places = geometry_places(g);
    if (m->n_places == 1 && g->slot_m == 0.0)
        return 0;
    double round_m = g->slot_m * (double)m->n_places;
    if (fabs(g->stage_axis[1] * round_m) > SAME_M) {
        *why = "a stage that stands at each position, or runs along x";
        return -ENOTSUP;
    }
    double *x_m = malloc(m->n_places * n_lines * sizeof *x_m);
    if (!x_m)
        return -ENOMEM;
    for (size_t j = 0; j < g->n_speakers; j++) {
        double on_m = geometry_gone_on_m(g, j) + 0.5 * g->echo_m;
        for (size_t x = 0; x < n_lines; x++)
            x_m[geometry_place(g, j) * n_lines + x] = m->x_m[x] + g->stage_axis[0] * on_m;
    }
    for (size_t q = 0; q < n; q++)
        m->ix[q] +=
            (uint32_t)(geometry_place(g, q % m->n_pairs / g->n_microphones) * n_lines);
    free(m->x_m);
    m->x_m = x_m;
    m->nx = m->n_places * n_lines;
    return 0;
}

static int find_ranges(struct midpoints *m, size_t n)
{
    m->x_range = malloc(m->ny * sizeof *m->x_range);
    if (!m->x_range)
        return -ENOMEM;
    for (size_t y = 0; y < m->ny; y++) {
        m->x_range[y][0] = m->nx;
        m->x_range[y][1] = 0;
    }
    for (size_t q = 0; q < n; q++) {
        size_t *range = m->x_range[m->iy[q]], x = m->ix[q];
        range[0] = x < range[0] ? x : range[0];
        range[1] = x + 1 > range[1] ? x + 1 : range[1];
    }
    return 0;
}

static double half_offset(const struct geometry *g, size_t pair)
{
    const double *s = g->speakers_m[pair / g->n_microphones];
    const double *m = g->microphones_m[pair % g->n_microphones];
    return 0.5 * hypot(s[0] - m[0], s[1] - m[1]);
}

static int sort_offsets(struct midpoints *m, const struct geometry *g)
{
    m->half_offset_m = malloc(m->n_pairs * sizeof *m->half_offset_m);
    m->offset = malloc(m->n_pairs * sizeof *m->offset);
    if (!m->half_offset_m || !m->offset)
        return -ENOMEM;
    for (size_t p = 0; p < m->n_pairs; p++)
        m->half_offset_m[p] = half_offset(g, p);
    m->n_offsets = lines_merge(m->half_offset_m, m->n_pairs, 0.1 * SAME_M);
    for (size_t p = 0; p < m->n_pairs; p++)
        m->offset[p] = lines_nearest(m->half_offset_m, m->n_offsets, half_offset(g, p));
    return 0;
}

int midpoints_create(struct midpoints **out, const struct geometry *g, const char **why)
{
    int err = check_plane(g, why);
    if (err)
        return err;
    struct midpoints *m = calloc(1, sizeof *m);
    if (!m)
        return -ENOMEM;
    m->n_pairs = g->n_speakers * g->n_microphones;
    m->plane_z_m = g->speakers_m[0][2];
    err = sort_axis(g, m->n_pairs, 0, &m->x_m, &m->nx, &m->ix);
    if (!err)
        err = sort_axis(g, m->n_pairs, 1, &m->y_m, &m->ny, &m->iy);
    if (!err)
        err = add_places(m, g, why);
    if (!err)
        err = find_ranges(m, g->n_positions * m->n_pairs);
    if (!err)
        err = sort_offsets(m, g);
    if (!err && m->nx * m->ny > MAX_CELLS) {
        *why = "midpoints on few lines of x and y (a straight array on a straight stage, "
               "or a lattice)";
        err = -ENOTSUP;
    }
    if (err) {
        midpoints_destroy(m);
        return err;
    }
    *out = m;
    return 0;
}

void midpoints_destroy(struct midpoints *m)
{
    if (!m)
        return;
    free(m->x_m);
    free(m->y_m);
    free(m->x_range);
    free(m->ix);
    free(m->iy);
    free(m->half_offset_m);
    free(m->offset);
    free(m);
}
