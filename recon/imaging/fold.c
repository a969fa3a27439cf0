/* SPDX-License-Identifier: MIT */
#include "recon/imaging/fold.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

size_t lines_merge(double *values, size_t n, double tolerance)
{
    qsort(values, n, sizeof *values, by_value);
    size_t lines = 0;
    for (size_t i = 0; i < n;) {
        size_t first = i;
        double sum = 0.0;
        while (i < n && values[i] - values[first] <= tolerance)
            sum += values[i++];
        values[lines++] = sum / (double)(i - first);
    }
    return lines;
}

uint32_t lines_nearest(const double *lines, size_t n, double value)
{
    size_t low = 0, high = n;
    while (high - low > 1) {
        size_t middle = (low + high) / 2;
        if (value < 0.5 * (lines[middle - 1] + lines[middle]))
            high = middle;
        else
            low = middle;
    }
    return (uint32_t)low;
}

#define SAME_M 1e-3 /* midpoints closer than this are one */

struct middle {
    uint32_t at[3]; /* lines of x, y, z */
    uint32_t trace;
};

static int by_place(const void *a, const void *b)
{
    return memcmp(((const struct middle *)a)->at, ((const struct middle *)b)->at,
                  sizeof((const struct middle *)a)->at);
}

static double coordinate(const struct geometry *g, size_t trace, int axis)
{
    double s[3], m[3];
    geometry_pair(g, trace, s, m);
    return 0.5 * (s[axis] + m[axis]);
}

/* On a stage that does not stop no two midpoints are the same: there those count as one
 * that would be on one that stands. */
int fold_number(const struct geometry *moving, uint32_t *cell, size_t *n_cells)
{
    const struct geometry standing = geometry_standing(moving), *g = &standing;
    size_t n = g->n_positions * g->n_speakers * g->n_microphones;
    struct middle *middles = calloc(n, sizeof *middles);
    double *values = malloc(n * sizeof *values), *lines = malloc(n * sizeof *lines);
    int err = middles && values && lines ? 0 : -ENOMEM;
    for (int axis = 0; !err && axis < 3; axis++) {
        for (size_t t = 0; t < n; t++)
            values[t] = coordinate(g, t, axis);
        memcpy(lines, values, n * sizeof *lines);
        size_t n_lines = lines_merge(lines, n, SAME_M);
        for (size_t t = 0; t < n; t++)
            middles[t].at[axis] = lines_nearest(lines, n_lines, values[t]);
    }
    if (!err) {
        for (size_t t = 0; t < n; t++)
            middles[t].trace = (uint32_t)t;
        qsort(middles, n, sizeof *middles, by_place);
        *n_cells = 0;
        for (size_t t = 0; t < n; t++) {
            if (t == 0 || by_place(&middles[t - 1], &middles[t]) != 0)
                ++*n_cells;
            cell[middles[t].trace] = (uint32_t)(*n_cells - 1);
        }
    }
    free(middles);
    free(values);
    free(lines);
    return err;
}

int fold_weights(const struct geometry *g, float **weight)
{
    size_t n = g->n_positions * g->n_speakers * g->n_microphones, n_cells;
    uint32_t *cell = malloc(n * sizeof *cell), *fold = calloc(n, sizeof *fold);
    *weight = malloc(n * sizeof **weight);
    int err = cell && fold && *weight ? fold_number(g, cell, &n_cells) : -ENOMEM;
    for (size_t t = 0; !err && t < n; t++)
        fold[cell[t]]++;
    for (size_t t = 0; !err && t < n; t++)
        (*weight)[t] = 1.0f / (float)fold[cell[t]];
    if (err) {
        free(*weight);
        *weight = NULL;
    }
    free(cell);
    free(fold);
    return err;
}
