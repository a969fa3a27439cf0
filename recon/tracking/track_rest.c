/* SPDX-License-Identifier: MIT */
#include "recon/tracking/track_rest.h"

#include <math.h>
#include <string.h>

#define UNKNOWNS    TRACK_REST_UNKNOWNS
#define AT_REST     TRACK_REST_AT_REST
#define FEW_LOOKS   5     /* with fewer neither a jump nor motion is told */
#define LOOSE_M     100.0 /* what is known beforehand: it is within so much of the array */
#define LOOSE_M_S   10.0  /* and not faster */
#define GAIN        20.0  /* motion explains so much more: in 1 of 2000 cases of noise */
#define GAIN_LEFT   15.0  /* and so many times what a whole look leaves */
#define AGREED_LEFT 4.0   /* the same where phases have it go as places do */
#define RARE_GAIN   9.5   /* the same of what is left of a background: in 1 of 20 */
#define RARE_LEFT   3.0
#define FAR_M       100.0 /* from the origin LOOSE_M would count for motion */

static void add_equation(struct track_rest *r, const double a[UNKNOWNS], double b,
                         double weight)
{
    for (int i = 0; i < UNKNOWNS; i++) {
        r->right[i] += weight * a[i] * b;
        for (int j = 0; j < UNKNOWNS; j++)
            r->normal[i][j] += weight * a[i] * a[j];
    }
    r->squares += weight * b * b;
}

static void fade(struct track_rest *r, double keep)
{
    for (int i = 0; i < UNKNOWNS; i++) {
        r->right[i] *= keep;
        for (int j = 0; j < UNKNOWNS; j++)
            r->normal[i][j] *= keep;
    }
    r->squares *= keep;
    r->looks *= keep;
}

/* The unknowns as they are since_s later: old = m new, so that normal = m' normal m. */
static void advance(struct track_rest *r, double since_s)
{
    const double s = since_s;
    const double m[UNKNOWNS][UNKNOWNS] = {
        {1, 0, 0, -s, 0, 0, 0}, {0, 1, 0, 0, -s, 0, 0}, {0, 0, 1, 0, 0, -s, s * s},
        {0, 0, 0, 1, 0, 0, 0},  {0, 0, 0, 0, 1, 0, 0},  {0, 0, 0, 0, 0, 1, -2.0 * s},
        {0, 0, 0, 0, 0, 0, 1}};
    double half[UNKNOWNS][UNKNOWNS] = {{0.0}}, normal[UNKNOWNS][UNKNOWNS] = {{0.0}};
    double right[UNKNOWNS] = {0.0};

    for (int i = 0; i < UNKNOWNS; i++)
        for (int j = 0; j < UNKNOWNS; j++)
            for (int k = 0; k < UNKNOWNS; k++)
                half[i][j] += r->normal[i][k] * m[k][j];
    for (int i = 0; i < UNKNOWNS; i++)
        for (int k = 0; k < UNKNOWNS; k++) {
            right[i] += m[k][i] * r->right[k];
            for (int j = 0; j < UNKNOWNS; j++)
                normal[i][j] += m[k][i] * half[k][j];
        }
    memcpy(r->normal, normal, sizeof normal);
    memcpy(r->right, right, sizeof right);
}

/* A look's two equations, of unit weight. */
struct equations {
    double a[2][UNKNOWNS], b[2], sigma[2];
};

static void set_equations(const struct track_rest *r, const struct track_rest_look *look,
                          struct equations *e)
{
    double p[2] = {look->array_m[0] - r->origin_m[0], look->array_m[1] - r->origin_m[1]};

    *e = (struct equations){
        .a = {{look->axis[0], look->axis[1]}, {-2.0 * p[0], -2.0 * p[1], 1.0}},
        .b = {look->along_m + look->axis[0] * p[0] + look->axis[1] * p[1],
              look->range_m * look->range_m - p[0] * p[0] - p[1] * p[1]},
        .sigma = {look->sigma_m, 2.0 * look->range_m * look->sigma_m}};
}

void track_rest_add(struct track_rest *r, const struct track_rest_look *look,
                    double share, int64_t stamp_ns, double memory_s)
{
    double since_s = 1e-9 * (double)(stamp_ns - r->newest_ns);
    struct equations e;

    if (hypot(look->array_m[0] - r->origin_m[0], look->array_m[1] - r->origin_m[1]) >
        FAR_M)
        *r = (struct track_rest){.looks = 0.0};
    if (r->looks > 0.0) {
        fade(r, exp(-since_s / memory_s));
        advance(r, since_s);
    } else {
        memcpy(r->origin_m, look->array_m, sizeof r->origin_m);
    }
    r->newest_ns = stamp_ns;
    set_equations(r, look, &e);
    for (int i = 0; i < 2; i++)
        add_equation(r, e.a[i], e.b[i], share / (e.sigma[i] * e.sigma[i]));
    r->looks += share;
    r->n_looks++;
}

/* Cholesky's, of a positive definite matrix, in its lower half. */
static void decompose(const struct track_rest *r, double l[UNKNOWNS][UNKNOWNS])
{
    const double loose[UNKNOWNS] = {LOOSE_M,
                                    LOOSE_M,
                                    LOOSE_M * LOOSE_M,
                                    LOOSE_M_S,
                                    LOOSE_M_S,
                                    LOOSE_M * LOOSE_M_S,
                                    LOOSE_M_S * LOOSE_M_S};

    memcpy(l, r->normal, sizeof r->normal);
    for (int i = 0; i < UNKNOWNS; i++)
        l[i][i] += 1.0 / (loose[i] * loose[i]);
    for (int j = 0; j < UNKNOWNS; j++) {
        for (int k = 0; k < j; k++)
            l[j][j] -= l[j][k] * l[j][k];
        l[j][j] = sqrt(l[j][j]);
        for (int i = j + 1; i < UNKNOWNS; i++) {
            for (int k = 0; k < j; k++)
                l[i][j] -= l[i][k] * l[j][k];
            l[i][j] /= l[j][j];
        }
    }
}

/* out = L^-1 b; two of them multiplied are b' (L L')^-1 b. */
static void forward(const double l[UNKNOWNS][UNKNOWNS], const double b[UNKNOWNS],
                    double out[UNKNOWNS])
{
    for (int i = 0; i < UNKNOWNS; i++) {
        out[i] = b[i];
        for (int k = 0; k < i; k++)
            out[i] -= l[i][k] * out[k];
        out[i] /= l[i][i];
    }
}

/* Of a scatterer at rest: the unknowns of motion come behind its own. */
static double dot(const double a[UNKNOWNS], const double b[UNKNOWNS])
{
    double sum = 0.0;

    for (int i = 0; i < AT_REST; i++)
        sum += a[i] * b[i];
    return sum;
}

/* What fits best, so that its squares are those that are explained, unknown by unknown.
 */
static void fit_looks(const struct track_rest *r, double l[UNKNOWNS][UNKNOWNS],
                      double fit[UNKNOWNS])
{
    decompose(r, l);
    forward((const double(*)[UNKNOWNS])l, r->right, fit);
}

double track_rest_misfit(const struct track_rest *r)
{
    /* chi-squared of f degrees of freedom (Laurent and Massart 2000, lemma 1): more than
     * f + 2 sqrt(f x) + 2 x in less than exp(-x) of all cases. */
    const double x = 18.0;
    double freedom = fmax(2.0 * r->looks - 2.0, 0.0);
    double limit = freedom + 2.0 * sqrt(freedom * x) + 2.0 * x;
    double l[UNKNOWNS][UNKNOWNS], fit[UNKNOWNS];

    if (!(r->looks > 0.0))
        return 0.0;
    fit_looks(r, l, fit);
    return fmax(r->squares - dot(fit, fit), 0.0) / limit;
}

void track_rest_motion(const struct track_rest *r, double *gain, double *left)
{
    double l[UNKNOWNS][UNKNOWNS], fit[UNKNOWNS];

    *gain = 0.0;
    fit_looks(r, l, fit);
    for (int i = AT_REST; i < UNKNOWNS; i++)
        *gain += fit[i] * fit[i];
    *left = fmax(r->squares - dot(fit, fit) - *gain, 0.0);
}

bool track_rest_moves(const struct track_rest *r, bool rest_is_rare, bool phases_agree)
{
    double least = rest_is_rare ? RARE_GAIN : GAIN, gain, left;
    double least_left = rest_is_rare ? RARE_LEFT : phases_agree ? AGREED_LEFT : GAIN_LEFT;

    if (r->n_looks < FEW_LOOKS)
        return false;
    track_rest_motion(r, &gain, &left);
    return gain > fmax(least, least_left * left / r->looks);
}

double track_rest_distance2(const struct track_rest *r,
                            const struct track_rest_look *look)
{
    double l[UNKNOWNS][UNKNOWNS], fit[UNKNOWNS], across[2][UNKNOWNS], left[2], c[2][2];
    struct equations e;

    fit_looks(r, l, fit);
    set_equations(r, look, &e);
    for (int i = 0; i < 2; i++) {
        forward((const double(*)[UNKNOWNS])l, e.a[i], across[i]);
        left[i] = e.b[i] - dot(across[i], fit);
    }
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
            c[i][j] = dot(across[i], across[j]) +
                      (i == j ? e.sigma[i] * e.sigma[i] : 0.0);
    double det = c[0][0] * c[1][1] - c[0][1] * c[1][0];
    return (c[1][1] * left[0] * left[0] - 2.0 * c[0][1] * left[0] * left[1] +
            c[0][0] * left[1] * left[1]) /
           det;
}

bool track_rest_jumps(const struct track_rest *r, const struct track_rest_look *look)
{
    double misfit = fmax(track_rest_misfit(r) / TRACK_REST_MISFIT, 1.0);

    return r->n_looks >= FEW_LOOKS &&
           track_rest_distance2(r, look) > misfit * misfit * TRACK_REST_GATE2;
}
