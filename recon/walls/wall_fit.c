/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_fit.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/rank.h"
#include "recon/geometry.h"

/* -- the first guess --------------------------------------------------------------------
 */

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

/* -- how much the echoes of a wall scatter, and what of it they share -------------------
 *
 * Residuals are taken apart into what is of each pair, of each speaker, each microphone
 * and each place of the array (that are not where they should be: variance components,
 * Searle, Casella and McCulloch 1992), and of what is shared by all. */

#define LEAST_SIGMA_M 2e-4 /* residuals are not believed to be smaller */

enum { WALL_FLAT = 3, WALL_BENT }; /* how many numbers say how a wall stands */

struct wall_row { /* one pair's echo that counts */
    size_t echo;
    double residual_m;
    double slope[WALL_BENT]; /* of its path, by the wall's two turns, its distance and how
                                it bends */
};

struct wall_rows {
    const struct wall_echo *echoes;
    size_t n;
    struct wall_row *list; /* [n] */
};

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
    double pair = fmax(pair_variance(f, g), LEAST_SIGMA_M * LEAST_SIGMA_M);
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

/* J' V J, [unknowns][unknowns]: J the slopes, V the covariance of the paths.  0,
 * -ENOMEM. */
static int wall_spread(const struct wall_rows *f, const struct wall_prior *prior,
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

/* -- the fit ----------------------------------------------------------------------------
 */

#define ROUNDS       10
#define STEP         1e-5 /* rad, m and 1/m, of the derivatives */
#define LEAST_HEARD  6    /* twice the unknowns of a plane */
#define LEAST_PIVOT  1e-9
#define MAD_TO_SIGMA 1.4826
#define WIDEN        1.5 /* the last tolerance, for echoes that scatter more */
#define TOLD_SIGMAS  3.0 /* by these it bends */
#define MOST_BENT    2.0 /* 1/m; what is thinner is a thing, not a wall */
#define FOCUS        0.9 /* of the curvature by which the echoes meet at the array */

struct fit {
    const struct wall_prior *prior;
    size_t n_echoes;
    struct wall_rows rows; /* of [n_echoes] */
    double *sorted_m;      /* [n_echoes] */
    size_t unknowns;       /* WALL_FLAT, WALL_BENT */
    double middle_m[3];    /* of the array */
    double tolerance_m, sigma_m;
};

static double path_m(const struct fit *f, size_t echo, const struct wall_fit *w)
{
    const struct wall *plane = &w->wall;
    const struct wall_echo *e = &f->rows.echoes[echo];

    return f->unknowns == WALL_FLAT
               ? wall_echo_path_m(e, &plane, 1)
               : wall_echo_bent_path_m(e, plane, f->middle_m, w->curvature_1_m);
}

static void change_by(const struct fit *f, const struct wall_fit *w, const double *change,
                      struct wall_fit *out)
{
    *out = *w;
    wall_turn(&w->wall, change, &out->wall);
    if (f->unknowns == WALL_BENT)
        out->curvature_1_m += change[WALL_FLAT];
}

/* Of each pair the echo nearest to the wall's path. */
static void choose(struct fit *f, const struct wall_fit *w)
{
    f->rows.n = 0;
    for (size_t i = 0; i < f->n_echoes;) {
        uint32_t pair = f->rows.echoes[i].pair;
        struct wall_row best = {.residual_m = f->tolerance_m};
        bool any = false;
        for (; i < f->n_echoes && f->rows.echoes[i].pair == pair; i++) {
            double r = f->rows.echoes[i].path_m - path_m(f, i, w);
            if (fabs(r) > fabs(best.residual_m))
                continue;
            best.residual_m = r;
            best.echo = i;
            any = true;
        }
        if (any)
            f->rows.list[f->rows.n++] = best;
    }
}

static void differentiate(struct fit *f, const struct wall_fit *w)
{
    for (size_t p = 0; p < f->unknowns; p++) {
        double change[WALL_BENT] = {0.0}, back[WALL_BENT] = {0.0};
        struct wall_fit ahead, behind;
        change[p] = STEP;
        back[p] = -STEP;
        change_by(f, w, change, &ahead);
        change_by(f, w, back, &behind);
        for (size_t i = 0; i < f->rows.n; i++) {
            struct wall_row *r = &f->rows.list[i];
            r->slope[p] = (path_m(f, r->echo, &ahead) - path_m(f, r->echo, &behind)) /
                          (2.0 * STEP);
        }
    }
}

static double robust_sigma_m(struct fit *f)
{
    for (size_t i = 0; i < f->rows.n; i++)
        f->sorted_m[i] = fabs(f->rows.list[i].residual_m);
    double middle_m = rank_double(f->sorted_m, f->rows.n, f->rows.n / 2 + 1);
    return fmax(MAD_TO_SIGMA * middle_m, LEAST_SIGMA_M);
}

/* a = J'WJ / sigma^2 + P, b = J'W r / sigma^2 + prior.  robust: W is Tukey's. */
static void accumulate(const struct fit *f, const struct wall *w, bool robust, double *a,
                       double *b)
{
    double scale = 1.0 / (f->sigma_m * f->sigma_m);
    size_t u = f->unknowns;
    memset(a, 0, u * u * sizeof *a);
    memset(b, 0, u * sizeof *b);
    for (size_t i = 0; i < f->rows.n; i++) {
        const struct wall_row *r = &f->rows.list[i];
        double off = robust ? r->residual_m / f->tolerance_m : 0.0;
        double weight = scale * (1.0 - off * off) * (1.0 - off * off);
        for (size_t p = 0; p < u; p++) {
            b[p] += weight * r->slope[p] * r->residual_m;
            for (size_t q = 0; q < u; q++)
                a[u * p + q] += weight * r->slope[p] * r->slope[q];
        }
    }
    if (!f->prior->vertical)
        return;
    double upright[3], level[3];
    wall_axes(w, upright, level);
    double weight = 1.0 / (f->prior->vertical_rad * f->prior->vertical_rad);
    const double slope[2] = {-level[1], upright[1]}; /* of the normal's y */
    for (size_t p = 0; p < 2; p++) {
        b[p] -= weight * slope[p] * w->normal[1];
        for (size_t q = 0; q < 2; q++)
            a[u * p + q] += weight * slope[p] * slope[q];
    }
}

/* Beyond these it is no wall whose echoes are heard; a fit stays there on its way. */
static double least_bent(const struct wall *w)
{
    return -FOCUS / fmax(fabs(w->distance_m), FOCUS / MOST_BENT);
}

static int round_of_fit(struct fit *f, struct wall_fit *w, bool robust)
{
    double a[WALL_BENT * WALL_BENT], b[WALL_BENT];
    choose(f, w);
    if (f->rows.n < LEAST_HEARD)
        return -EDOM;
    differentiate(f, w);
    f->sigma_m = robust_sigma_m(f);
    accumulate(f, &w->wall, robust, a, b);
    if (normal_equations_solve(f->unknowns, a, b, LEAST_PIVOT))
        return -EDOM;
    change_by(f, w, b, w);
    w->curvature_1_m = fmin(fmax(w->curvature_1_m, least_bent(&w->wall)), MOST_BENT);
    return 0;
}

/* A^-1 (J'VJ / sigma^4 + P) A^-1 for what was estimated with A = J'J / sigma^2 + P. */
static int covariance(const struct fit *f, const struct wall *w, double *out)
{
    enum { MOST = WALL_BENT * WALL_BENT };
    double a[MOST], b[WALL_BENT], middle[MOST], inverse[MOST];
    double scale = 1.0 / (f->sigma_m * f->sigma_m);
    size_t u = f->unknowns;
    int err = wall_spread(&f->rows, f->prior, u, middle);
    if (err)
        return err;
    accumulate(f, w, false, a, b);
    for (size_t q = 0; q < u * u; q++) { /* P is what a has over J'J / sigma^2 */
        double measured = 0.0;
        for (size_t i = 0; i < f->rows.n; i++)
            measured += scale * f->rows.list[i].slope[q / u] *
                        f->rows.list[i].slope[q % u];
        middle[q] = middle[q] * scale * scale + a[q] - measured;
    }
    for (size_t p = 0; p < u; p++) {
        double copy[MOST], column[WALL_BENT] = {0.0};
        memcpy(copy, a, sizeof copy);
        column[p] = 1.0;
        if (normal_equations_solve(u, copy, column, LEAST_PIVOT))
            return -EDOM;
        for (size_t q = 0; q < u; q++)
            inverse[u * q + p] = column[q];
    }
    for (size_t p = 0; p < u; p++)
        for (size_t q = 0; q < u; q++) {
            double sum = 0.0;
            for (size_t i = 0; i < u * u; i++)
                sum += inverse[u * p + i / u] * middle[i] * inverse[u * (i % u) + q];
            out[u * p + q] = sum;
        }
    return 0;
}

/* curvature_sigma_1_m: NULL of a plane. */
static int fit_all(struct fit *f, struct wall_fit *fit, const double tolerance_m[2],
                   double *curvature_sigma_1_m)
{
    double spread[WALL_BENT * WALL_BENT];
    int err = 0;
    f->unknowns = curvature_sigma_1_m ? WALL_BENT : WALL_FLAT;
    f->tolerance_m = tolerance_m[0];
    for (int k = 0; !err && k < ROUNDS; k++) {
        err = round_of_fit(f, fit, true);
        double narrow = fmax(tolerance_m[1], 4.0 * f->sigma_m);
        f->tolerance_m = fmax(fmin(narrow, 0.8 * f->tolerance_m), tolerance_m[1]);
    }
    f->tolerance_m = fmin(fmax(4.0 * f->sigma_m, tolerance_m[1]), WIDEN * tolerance_m[1]);
    for (int k = 0; !err && k < 2; k++)
        err = round_of_fit(f, fit, false);
    if (!err)
        choose(f, fit);
    if (!err && f->rows.n < LEAST_HEARD)
        err = -EDOM;
    if (err)
        return err;
    differentiate(f, fit);
    double sum = 0.0;
    for (size_t i = 0; i < f->rows.n; i++)
        sum += f->rows.list[i].residual_m * f->rows.list[i].residual_m;
    fit->rms_m = sqrt(sum / (double)f->rows.n);
    fit->n_heard = f->rows.n;
    err = covariance(f, &fit->wall, spread);
    for (size_t p = 0, k = 0; !err && p < WALL_FLAT; p++)
        for (size_t q = p; q < WALL_FLAT; q++, k++)
            fit->wall.covariance[k] = spread[f->unknowns * p + q];
    if (!err && curvature_sigma_1_m)
        *curvature_sigma_1_m = sqrt(spread[WALL_BENT * WALL_BENT - 1]);
    return err;
}

static void tell_chosen(const struct fit *f, bool *chosen)
{
    for (size_t i = 0; i < f->n_echoes; i++)
        chosen[i] = false;
    for (size_t i = 0; i < f->rows.n; i++)
        chosen[f->rows.list[i].echo] = true;
}

static void find_middle(struct fit *f)
{
    for (size_t i = 0; i < f->n_echoes; i++)
        for (int a = 0; a < 3; a++)
            f->middle_m[a] +=
                0.5 *
                (f->rows.echoes[i].speaker_m[a] + f->rows.echoes[i].microphone_m[a]) /
                (double)f->n_echoes;
}

/* By less it may be the elements that are not where they should be; at a limit it is
 * none.
 */
static bool bends(const struct wall_fit *bent, const struct wall_fit *flat,
                  double sigma_1_m)
{
    return bent->n_heard >= flat->n_heard && bent->curvature_1_m < MOST_BENT &&
           bent->curvature_1_m > least_bent(&bent->wall) &&
           fabs(bent->curvature_1_m) >= TOLD_SIGMAS * sigma_1_m;
}

/* A plane first; then, where that tells more, what bends.  No -EDOM of the latter. */
static int fit_both(struct fit *f, struct wall_fit *fit, const double tolerance_m[2],
                    bool *chosen)
{
    double sigma_1_m = 0.0;
    int err = fit_all(f, fit, tolerance_m, NULL);

    if (err)
        return err;
    if (chosen)
        tell_chosen(f, chosen);
    struct wall_fit bent = *fit;
    err = fit_all(f, &bent, tolerance_m, &sigma_1_m);
    if (err)
        return err == -EDOM ? 0 : err;
    if (!bends(&bent, fit, sigma_1_m))
        return 0;
    *fit = bent;
    if (chosen)
        tell_chosen(f, chosen);
    return 0;
}

int wall_fit_improve(struct wall_fit *fit, const struct wall_prior *prior,
                     const struct wall_echo *echoes, size_t n,
                     const double tolerance_m[2], bool *chosen)
{
    struct fit f = {.prior = prior, .rows = {.echoes = echoes}, .n_echoes = n};
    f.rows.list = calloc(n + 1, sizeof *f.rows.list);
    f.sorted_m = calloc(n + 1, sizeof *f.sorted_m);
    fit->curvature_1_m = 0.0;
    find_middle(&f);
    int err = f.rows.list && f.sorted_m ? fit_both(&f, fit, tolerance_m, chosen)
                                        : -ENOMEM;
    free(f.rows.list);
    free(f.sorted_m);
    return err;
}
