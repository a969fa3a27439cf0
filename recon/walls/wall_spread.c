/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_spread.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Sums of residuals and slopes over the echoes that share an element or a place. */
struct group {
    size_t n;
    double sum, slope[WALL_BENT];
};

enum { SPEAKERS, MICROPHONES, PLACES, KINDS };

struct groups {
    size_t n;
    struct group *list; /* [n] */
};

static uint32_t number_of(const struct wall_echo *e, int kind)
{
    return kind == SPEAKERS ? e->speaker : kind == MICROPHONES ? e->microphone : e->place;
}

static const struct group *group_of(const struct groups *g, const struct wall_echo *e,
                                    int kind)
{
    return &g[kind].list[number_of(e, kind)];
}

static int group_rows(const struct wall_rows *f, int kind, struct groups *out)
{
    for (size_t i = 0; i < f->n; i++) {
        size_t k = number_of(&f->echoes[f->list[i].echo], kind);
        out->n = k >= out->n ? k + 1 : out->n;
    }
    out->list = calloc(out->n, sizeof *out->list);
    for (size_t i = 0; out->list && i < f->n; i++) {
        struct group *g = &out->list[number_of(&f->echoes[f->list[i].echo], kind)];
        g->n++;
        g->sum += f->list[i].residual_m;
        for (int p = 0; p < WALL_BENT; p++)
            g->slope[p] += f->list[i].slope[p];
    }
    return out->list ? 0 : -ENOMEM;
}

static size_t groups_used(const struct groups *g)
{
    size_t used = 0;
    for (size_t k = 0; k < g->n; k++)
        used += g->list[k].n > 0;
    return used;
}

/* The variance of the errors that a group shares: of the groups' means, less what the
 * pairs' errors make of it.  The fit has taken about two of its numbers from each kind.
 */
static double shared_variance(const struct groups *g, double pair_variance)
{
    double sum = 0.0, expected = 0.0;
    size_t used = groups_used(g);
    if (used < 4)
        return 0.0;
    for (size_t k = 0; k < g->n; k++) {
        if (!g->list[k].n)
            continue;
        double mean = g->list[k].sum / (double)g->list[k].n;
        sum += mean * mean / ((double)used - 2.0);
        expected += pair_variance / (double)g->list[k].n / (double)used;
    }
    return fmax(0.0, sum - expected);
}

/* What is left of the residuals when the means of their groups are taken off. */
static double pair_variance(const struct wall_rows *f, const struct groups g[KINDS])
{
    double mean = 0.0, all = 0.0, sum = 0.0;
    size_t used = 0;
    for (int kind = 0; kind < KINDS; kind++)
        used += groups_used(&g[kind]);
    for (size_t i = 0; i < f->n; i++) {
        mean += f->list[i].residual_m / (double)f->n;
        all += f->list[i].residual_m * f->list[i].residual_m;
    }
    if (f->n < 2 * used)
        return all / ((double)f->n - 3.0);
    for (size_t i = 0; i < f->n; i++) {
        double left = f->list[i].residual_m + (KINDS - 1) * mean;
        for (int kind = 0; kind < KINDS; kind++) {
            const struct group *of = group_of(g, &f->echoes[f->list[i].echo], kind);
            left -= of->sum / (double)of->n;
        }
        sum += left * left;
    }
    return sum / (double)(f->n - used + KINDS - 1);
}

static void add_square(size_t n, double *m, const double *v, double weight)
{
    for (size_t p = 0; p < n; p++)
        for (size_t q = 0; q < n; q++)
            m[n * p + q] += weight * v[p] * v[q];
}

/* J' V J, with V of pairs, of what groups share and of what all share. */
static void add_spread(const struct wall_rows *f, const struct wall_prior *prior,
                       const struct groups g[KINDS], size_t unknowns, double *out)
{
    double speed[WALL_BENT] = {0.0}, delay[WALL_BENT] = {0.0};
    double pair = fmax(pair_variance(f, g), WALL_LEAST_SIGMA_M * WALL_LEAST_SIGMA_M);
    for (int kind = 0; kind < KINDS; kind++) {
        double shared = shared_variance(&g[kind], pair);
        for (size_t k = 0; k < g[kind].n; k++)
            add_square(unknowns, out, g[kind].list[k].slope, shared);
    }
    for (size_t i = 0; i < f->n; i++) {
        const struct wall_row *r = &f->list[i];
        add_square(unknowns, out, r->slope, pair);
        for (size_t p = 0; p < unknowns; p++) {
            speed[p] += r->slope[p] * f->echoes[r->echo].path_m;
            delay[p] += r->slope[p];
        }
    }
    add_square(unknowns, out, speed, prior->sound_speed * prior->sound_speed);
    add_square(unknowns, out, delay, prior->delay_m * prior->delay_m);
}

int wall_spread(const struct wall_rows *f, const struct wall_prior *prior,
                size_t unknowns, double *out)
{
    struct groups g[KINDS] = {{0, NULL}, {0, NULL}, {0, NULL}};
    int err = 0;
    memset(out, 0, unknowns * unknowns * sizeof *out);
    for (int kind = 0; !err && kind < KINDS; kind++)
        err = group_rows(f, kind, &g[kind]);
    if (!err)
        add_spread(f, prior, (const struct groups *)g, unknowns, out);
    for (int kind = 0; kind < KINDS; kind++)
        free(g[kind].list);
    return err;
}
