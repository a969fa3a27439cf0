/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_fit.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/rank.h"

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
    return fmax(MAD_TO_SIGMA * middle_m, WALL_LEAST_SIGMA_M);
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
