/* SPDX-License-Identifier: MIT */
#include "recon/walls/wall_fit.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/normal_equations.h"
#include "dsp/rank.h"

#define ROUNDS       10
#define STEP         1e-5 /* rad and m, of the derivatives */
#define LEAST_HEARD  6    /* twice the unknowns */
#define LEAST_PIVOT  1e-9
#define MAD_TO_SIGMA 1.4826
#define WIDEN        1.5 /* the last tolerance, for echoes that scatter more */

struct fit {
    const struct wall_prior *prior;
    size_t n_echoes;
    struct wall_rows rows; /* of [n_echoes] */
    double *sorted_m;      /* [n_echoes] */
    double tolerance_m, sigma_m;
};

static double path_m(const struct fit *f, size_t echo, const struct wall *w)
{
    return wall_echo_path_m(&f->rows.echoes[echo], &w, 1);
}

/* Of each pair the echo nearest to the wall's path. */
static void choose(struct fit *f, const struct wall *w)
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

static void differentiate(struct fit *f, const struct wall *w)
{
    for (int p = 0; p < 3; p++) {
        double change[3] = {0.0}, back[3] = {0.0};
        struct wall ahead, behind;
        change[p] = STEP;
        back[p] = -STEP;
        wall_turn(w, change, &ahead);
        wall_turn(w, back, &behind);
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
static void accumulate(const struct fit *f, const struct wall *w, bool robust,
                       double a[9], double b[3])
{
    double scale = 1.0 / (f->sigma_m * f->sigma_m);
    memset(a, 0, 9 * sizeof *a);
    memset(b, 0, 3 * sizeof *b);
    for (size_t i = 0; i < f->rows.n; i++) {
        const struct wall_row *r = &f->rows.list[i];
        double u = robust ? r->residual_m / f->tolerance_m : 0.0;
        double weight = scale * (1.0 - u * u) * (1.0 - u * u);
        for (int p = 0; p < 3; p++) {
            b[p] += weight * r->slope[p] * r->residual_m;
            for (int q = 0; q < 3; q++)
                a[3 * p + q] += weight * r->slope[p] * r->slope[q];
        }
    }
    if (!f->prior->vertical)
        return;
    double upright[3], level[3];
    wall_axes(w, upright, level);
    double weight = 1.0 / (f->prior->vertical_rad * f->prior->vertical_rad);
    const double slope[2] = {-level[1], upright[1]}; /* of the normal's y */
    for (int p = 0; p < 2; p++) {
        b[p] -= weight * slope[p] * w->normal[1];
        for (int q = 0; q < 2; q++)
            a[3 * p + q] += weight * slope[p] * slope[q];
    }
}

static int round_of_fit(struct fit *f, struct wall *w, bool robust)
{
    double a[9], b[3];
    choose(f, w);
    if (f->rows.n < LEAST_HEARD)
        return -EDOM;
    differentiate(f, w);
    f->sigma_m = robust_sigma_m(f);
    accumulate(f, w, robust, a, b);
    if (normal_equations_solve(3, a, b, LEAST_PIVOT))
        return -EDOM;
    wall_turn(w, b, w);
    return 0;
}

/* A^-1 (J'VJ / sigma^4 + P) A^-1 for what was estimated with A = J'J / sigma^2 + P. */
static int covariance(const struct fit *f, struct wall *w)
{
    double a[9], b[3], middle[9], inverse[9];
    double scale = 1.0 / (f->sigma_m * f->sigma_m);
    int err = wall_spread(&f->rows, f->prior, middle);
    if (err)
        return err;
    accumulate(f, w, false, a, b);
    for (int q = 0; q < 9; q++) { /* P is what a has over J'J / sigma^2 */
        double measured = 0.0;
        for (size_t i = 0; i < f->rows.n; i++)
            measured += scale * f->rows.list[i].slope[q / 3] *
                        f->rows.list[i].slope[q % 3];
        middle[q] = middle[q] * scale * scale + a[q] - measured;
    }
    for (int p = 0; p < 3; p++) {
        double copy[9], column[3] = {p == 0, p == 1, p == 2};
        memcpy(copy, a, sizeof copy);
        if (normal_equations_solve(3, copy, column, LEAST_PIVOT))
            return -EDOM;
        for (int q = 0; q < 3; q++)
            inverse[3 * q + p] = column[q];
    }
    for (int p = 0, k = 0; p < 3; p++)
        for (int q = p; q < 3; q++, k++) {
            w->covariance[k] = 0.0;
            for (int i = 0; i < 9; i++)
                w->covariance[k] += inverse[3 * p + i / 3] * middle[i] *
                                    inverse[3 * (i % 3) + q];
        }
    return 0;
}

static int fit_all(struct fit *f, struct wall_fit *fit, const double tolerance_m[2])
{
    int err = 0;
    f->tolerance_m = tolerance_m[0];
    for (int k = 0; !err && k < ROUNDS; k++) {
        err = round_of_fit(f, &fit->wall, true);
        double narrow = fmax(tolerance_m[1], 4.0 * f->sigma_m);
        f->tolerance_m = fmax(fmin(narrow, 0.8 * f->tolerance_m), tolerance_m[1]);
    }
    f->tolerance_m = fmin(fmax(4.0 * f->sigma_m, tolerance_m[1]), WIDEN * tolerance_m[1]);
    for (int k = 0; !err && k < 2; k++)
        err = round_of_fit(f, &fit->wall, false);
    if (!err)
        choose(f, &fit->wall);
    if (!err && f->rows.n < LEAST_HEARD)
        err = -EDOM;
    if (err)
        return err;
    differentiate(f, &fit->wall);
    double sum = 0.0;
    for (size_t i = 0; i < f->rows.n; i++)
        sum += f->rows.list[i].residual_m * f->rows.list[i].residual_m;
    fit->rms_m = sqrt(sum / (double)f->rows.n);
    fit->n_heard = f->rows.n;
    return covariance(f, &fit->wall);
}

int wall_fit_improve(struct wall_fit *fit, const struct wall_prior *prior,
                     const struct wall_echo *echoes, size_t n,
                     const double tolerance_m[2], bool *chosen)
{
    struct fit f = {.prior = prior, .rows = {.echoes = echoes}, .n_echoes = n};
    f.rows.list = calloc(n + 1, sizeof *f.rows.list);
    f.sorted_m = calloc(n + 1, sizeof *f.sorted_m);
    int err = f.rows.list && f.sorted_m ? fit_all(&f, fit, tolerance_m) : -ENOMEM;
    for (size_t i = 0; chosen && i < n; i++)
        chosen[i] = false;
    for (size_t i = 0; !err && chosen && i < f.rows.n; i++)
        chosen[f.rows.list[i].echo] = true;
    free(f.rows.list);
    free(f.sorted_m);
    return err;
}
