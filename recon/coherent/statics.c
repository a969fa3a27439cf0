/* SPDX-License-Identifier: MIT */
#include "recon/coherent/statics.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LEAST_ELEMENTS 3 /* of each kind: two are always on a line */
#define MOST_GROUPS    8
#define MOST_EVERY     64.0

struct place {
    double along_m;
    size_t element;
};

static int by_place(const void *a, const void *b)
{
    const struct place *x = a, *y = b;
    return (x->along_m > y->along_m) - (x->along_m < y->along_m);
}

/* Speakers or microphones: their order along the line, and what tells its pitch. */
struct row {
    size_t n;
    const double (*at_m)[3];
    double (*line_m)[3]; /* the same on the line */
    double middle_m[3], rise, run;
    double every; /* pitches of the line from one to the next */
};

static void measure(struct row *r, int axis, struct place *order)
{
    double middle = 0.5 * (double)(r->n - 1);
    memset(r->middle_m, 0, sizeof r->middle_m);
    for (size_t e = 0; e < r->n; e++) {
        order[e] = (struct place){r->at_m[e][axis], e};
        for (int a = 0; a < 3; a++)
            r->middle_m[a] += r->at_m[e][a] / (double)r->n;
    }
    qsort(order, r->n, sizeof *order, by_place);
    for (size_t k = 0; k < r->n; k++) {
        r->rise += ((double)k - middle) * (order[k].along_m - r->middle_m[axis]);
        r->run += ((double)k - middle) * ((double)k - middle);
    }
}

/* One pitch for both, of which one kind may take several. */
static double pitch_of(struct row rows[2])
{
    double pitch_m[2] = {rows[0].rise / rows[0].run, rows[1].rise / rows[1].run};
    int wide = pitch_m[1] > pitch_m[0];
    rows[wide].every = fmin(rint(pitch_m[wide] / pitch_m[!wide]), MOST_EVERY);
    double rise = rows[0].every * rows[0].rise + rows[1].every * rows[1].rise;
    double run = rows[0].every * rows[0].every * rows[0].run +
                 rows[1].every * rows[1].every * rows[1].run;
    return rise / run;
}

/* Onto the line; how far the farthest was from it. */
static double straighten(const struct row *r, int axis, const struct place *order,
                         double pitch_m)
{
    double farthest = 0.0, middle = 0.5 * (double)(r->n - 1);
    for (size_t k = 0; k < r->n; k++) {
        double *line = r->line_m[order[k].element];
        memcpy(line, r->middle_m, sizeof r->middle_m);
        line[axis] += r->every * pitch_m * ((double)k - middle);
        for (int a = 0; a < 3; a++)
            farthest = fmax(farthest, fabs(line[a] - r->at_m[order[k].element][a]));
    }
    return farthest;
}

static int longest_axis(const struct geometry *g)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (size_t j = 0; j < g->n_speakers; j++)
        for (int a = 0; a < 2; a++) {
            low[a] = fmin(low[a], g->speakers_m[j][a]);
            high[a] = fmax(high[a], g->speakers_m[j][a]);
        }
    return high[1] - low[1] >= high[0] - low[0];
}

static int find_line(struct statics *s, const struct geometry *g, const char **why)
{
    struct row rows[2] = {
        {g->n_speakers, g->speakers_m, (double(*)[3])s->line.speakers_m, {0}, 0, 0, 1},
        {g->n_microphones,
         g->microphones_m,
         (double(*)[3])s->line.microphones_m,
         {0},
         0,
         0,
         1}};
    struct place *order[2] = {malloc(g->n_speakers * sizeof **order),
                              malloc(g->n_microphones * sizeof **order)};
    double farthest = 0.0;
    int axis = longest_axis(g), err = order[0] && order[1] ? 0 : -ENOMEM;
    for (int k = 0; k < 2 && !err; k++)
        measure(&rows[k], axis, order[k]);
    double pitch_m = err ? 0.0 : pitch_of(rows);
    double plane_m = 0.5 * (rows[0].middle_m[2] + rows[1].middle_m[2]);
    for (int k = 0; k < 2 && !err; k++) {
        rows[k].middle_m[2] = plane_m;
        farthest = fmax(farthest, straighten(&rows[k], axis, order[k], pitch_m));
    }
    if (!err && !(farthest <= STATICS_MOST_M)) {
        *why = "speakers and microphones in one plane z = constant on few lines, or each "
               "within 3 cm of a straight, even line";
        err = -ENOTSUP;
    }
    free(order[0]);
    free(order[1]);
    return err;
}

static double path_m(const struct geometry *g, size_t pair, const double carried_m[3],
                     const double target_m[3])
{
    double speaker[3], microphone[3];
    for (int a = 0; a < 3; a++) {
        speaker[a] = g->speakers_m[pair / g->n_microphones][a] + carried_m[a];
        microphone[a] = g->microphones_m[pair % g->n_microphones][a] + carried_m[a];
    }
    return geometry_distance(speaker, target_m) + geometry_distance(target_m, microphone);
}

static int find_shifts(struct statics *s, const struct geometry *g,
                       const double target_m[3])
{
    size_t n_pairs = g->n_speakers * g->n_microphones;
    s->n_groups = g->n_positions < MOST_GROUPS ? g->n_positions : MOST_GROUPS;
    double *sums = calloc(s->n_groups * n_pairs, sizeof *sums);
    size_t *counts = calloc(s->n_groups, sizeof *counts);
    s->shift_s = sums;
    if (!sums || !counts) {
        free(counts);
        return -ENOMEM;
    }
    for (size_t k = 0; k < g->n_positions; k++) {
        size_t group = statics_group(s, k) / n_pairs;
        double carried_m[3];
        for (int a = 0; a < 3; a++)
            carried_m[a] = g->stage_axis[a] * g->stage_positions_m[k];
        for (size_t p = 0; p < n_pairs; p++)
            sums[group * n_pairs + p] += (path_m(g, p, carried_m, target_m) -
                                          path_m(&s->line, p, carried_m, target_m)) /
                                         g->sound_speed_m_s;
        counts[group]++;
    }
    for (size_t q = 0; q < s->n_groups * n_pairs; q++)
        sums[q] /= (double)counts[q / n_pairs];
    free(counts);
    return 0;
}

int statics_create(struct statics **out, const struct geometry *g,
                   const double target_m[3], const char **why)
{
    if (g->pings_m || g->n_speakers < LEAST_ELEMENTS ||
        g->n_microphones < LEAST_ELEMENTS || fabs(g->stage_axis[2]) > 1e-3) {
        *why = "speakers and microphones in one plane z = constant, and a stage along it";
        return -ENOTSUP;
    }
    struct statics *s = calloc(1, sizeof *s);
    int err = s ? geometry_copy(&s->line, g) : -ENOMEM;
    if (!err)
        err = find_line(s, g, why);
    if (!err)
        err = find_shifts(s, g, target_m);
    if (err)
        statics_destroy(s);
    else
        *out = s;
    return err;
}

size_t statics_group(const struct statics *s, size_t position)
{
    return position * s->n_groups / s->line.n_positions * s->line.n_speakers *
           s->line.n_microphones;
}

void statics_destroy(struct statics *s)
{
    if (!s)
        return;
    geometry_clear(&s->line);
    free(s->shift_s);
    free(s);
}
