/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm.c -- the iterations, their stopping rule, and rho; see admm_plan.h.
 */
#include "recon/inverse/admm_plan.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/inverse/admm_shrink.h"

#define RELAXATION  1.8 /* Boyd 3.4.3 */
#define CHECK_EVERY 5   /* iterations between looks at the residuals */
#define BALANCE     3.0 /* residuals farther apart than this move rho */
#define RHO_STEP    4.0 /* at most, at once */
#define RHO_CALM                                                                         \
    1.5                /* the next change comes at so many times this iteration: their   \
                        * number is bounded, as convergence asks (Boyd 3.4.1) */
#define RHO_LEAST 1e-6 /* in units of |K|^2 */
#define RHO_MOST  1e6
#define FLOOR     1e-3 /* residuals are relative to at least this much of K' b */
#define ALIGNMENT 16   /* floats */

static bool sensible(const struct admm_config *c)
{
    bool ok = c->pool && c->n[0] && c->n[1] && c->n[2] && c->rho > 0.0;
    ok = ok && c->l1 >= 0.0 && isfinite(c->l1) && c->tv >= 0.0 && isfinite(c->tv);
    ok = ok && isfinite(c->rho) && c->tolerance >= 0.0;
    ok = ok && (c->relaxation == 0.0 || (c->relaxation >= 1.0 && c->relaxation <= 1.9));
    return ok && (!c->linear || c->linear->n_data);
}

static int allocate(struct admm *a)
{
    size_t threads = pool_threads(a->cfg.pool);
    a->scratch = calloc(threads, sizeof *a->scratch);
    a->x = fftwf_malloc(a->nz * a->plane * sizeof *a->x);
    if (!a->scratch || !a->x)
        return -ENOMEM;
    for (size_t t = 0; t < threads; t++) {
        a->scratch[t].rows = calloc(admm_split_scratch(a), sizeof(float));
        a->scratch[t].plane = fftwf_malloc(a->plane * sizeof(float));
        if (!a->scratch[t].rows || !a->scratch[t].plane)
            return -ENOMEM;
    }
    for (size_t d = 0; d < a->parts; d++)
        for (int side = 0; side < 2; side++)
            if (!(a->v[side][d] = malloc(a->nz * a->plane * sizeof(float))))
                return -ENOMEM;
    return 0;
}

int admm_create(struct admm **out, const struct admm_config *cfg)
{
    if (!sensible(cfg))
        return -EINVAL;
    struct admm *a = calloc(1, sizeof *a);
    if (!a)
        return -ENOMEM;
    a->cfg = *cfg;
    if (cfg->linear)
        a->linear = *cfg->linear;
    a->cfg.linear = NULL;
    if (a->cfg.relaxation == 0.0)
        a->cfg.relaxation = RELAXATION;
    a->nx = cfg->n[0];
    a->ny = cfg->n[1];
    a->nz = cfg->n[2];
    a->n = a->nx * a->ny * a->nz;
    a->parts = cfg->tv > 0.0 ? ADMM_PARTS : 1;
    a->plane = a->nx * a->ny;
    if (!cfg->linear) /* planes of a blur are transformed where they lie */
        a->plane = (a->plane + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    int err = allocate(a);
    if (!err)
        err = admm_blur_create(a);
    if (!err && cfg->linear)
        err = admm_normal_create(a);
    if (err) {
        admm_destroy(a);
        return err;
    }
    if (!cfg->linear) /* until one is given, nothing is blurred */
        admm_blur_gaussian(a, (const double[6]){0});
    *out = a;
    return 0;
}

void admm_destroy(struct admm *a)
{
    if (!a)
        return;
    admm_normal_destroy(a);
    admm_blur_destroy(a);
    for (size_t t = 0; a->scratch && t < pool_threads(a->cfg.pool); t++) {
        free(a->scratch[t].rows);
        fftwf_free(a->scratch[t].plane);
        fftwf_free(a->scratch[t].column);
    }
    for (size_t d = 0; d < ADMM_PARTS; d++) {
        free(a->v[0][d]);
        free(a->v[1][d]);
    }
    fftwf_free(a->x);
    free(a->scratch);
    free(a);
}

/* -- one solve --------------------------------------------------------------------------
 */

static double largest_of(const float *x, size_t n)
{
    float largest = 0.0f;
    for (size_t i = 0; i < n; i++)
        largest = fmaxf(largest, fabsf(x[i]));
    return (double)largest;
}

/* Largest positive value and length of K' b, which stands in x. */
static void survey(const struct admm *a, double *largest, double *length)
{
    double sum = 0.0;
    float most = 0.0f;
    for (size_t z = 0; z < a->nz; z++) {
        const float *x = a->x + z * a->plane;
        for (size_t i = 0; i < a->nx * a->ny; i++) {
            most = fmaxf(most, x[i]);
            sum += (double)x[i] * (double)x[i];
        }
    }
    *largest = (double)most;
    *length = sqrt(sum);
}

struct residuals {
    double primal, dual; /* relative */
};

static struct residuals read_residuals(const struct admm *a, double length)
{
    struct admm_norms n;
    admm_split_norms(a, &n);
    double ax = fmax(sqrt(fmax(n.ax, n.z)), FLOOR * length);
    double dual = fmax(sqrt(n.dual), FLOOR * length / a->rho);
    return (struct residuals){sqrt(n.gap) / ax, sqrt(n.change) / dual};
}

/* The larger residual gets more weight: sqrt of their ratio, towards balance. */
static void balance(struct admm *a, const struct residuals *r)
{
    double ratio = r->primal / fmax(r->dual, DBL_MIN);
    if (ratio > 1.0 / BALANCE && ratio < BALANCE)
        return;
    double factor = fmin(fmax(sqrt(ratio), 1.0 / RHO_STEP), RHO_STEP);
    double rho = fmin(fmax(a->rho * factor, RHO_LEAST), RHO_MOST);
    if (rho != a->rho)
        admm_shrink_rescale(a, rho);
}

static void iterate(struct admm *a, double length, struct admm_result *result)
{
    void (*emit)(struct admm *, size_t, size_t) = admm_blur_emit;
    void (*update)(struct admm *) = admm_blur_update;
    if (a->linear.forward) {
        emit = admm_normal_emit;
        update = admm_normal_update;
    }
    struct residuals r = {0};
    size_t calm = CHECK_EVERY; /* rho may change from this iteration on */
    for (size_t i = 1; i <= a->cfg.iterations && !result->converged; i++) {
        a->check = i % CHECK_EVERY == 0 || i == a->cfg.iterations;
        admm_split(a, emit);
        result->iterations = i;
        if (a->check) {
            r = read_residuals(a, length);
            result->primal = r.primal;
            result->dual = r.dual;
            result->converged = fmax(r.primal, r.dual) <= a->cfg.tolerance;
        }
        if (result->converged || i == a->cfg.iterations)
            break;
        update(a);
        if (a->check && i >= calm) {
            balance(a, &r);
            calm = (size_t)(RHO_CALM * (double)i);
        }
    }
}

static double total_variation(const struct admm *a, const float *x)
{
    double sum = 0.0;
    size_t wrap = !a->linear.forward, layer = a->nx * a->ny;
    for (size_t i = 0; i < a->n; i++) {
        size_t at[3] = {i % a->nx, i / a->nx % a->ny, i / layer};
        size_t stride[3] = {1, a->nx, layer};
        double d[3];
        for (int q = 0; q < 3; q++) {
            bool last = at[q] + 1 == a->cfg.n[q];
            size_t next = last ? (wrap ? i - at[q] * stride[q] : i) : i + stride[q];
            d[q] = (double)x[next] - (double)x[i];
        }
        sum += a->cfg.tv_isotropic ? sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                                   : fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    }
    return sum;
}

/* The split copy of x: it is what satisfies x >= 0. */
static void take_result(const struct admm *a, float *x)
{
    for (size_t z = 0; z < a->nz; z++) {
        const float *v = a->v[0][ADMM_SELF] + z * a->plane;
        for (size_t i = 0; i < a->nx * a->ny; i++)
            x[z * a->nx * a->ny + i] = fmaxf(v[i] - a->kappa[0], 0.0f);
    }
}

static void finish(struct admm *a, const float *b, float *x, struct admm_result *result)
{
    double scale2 = a->scale * a->scale, sum = 0.0;
    double l1 = a->kappa[0] * a->rho, tv = a->kappa[1] * a->rho;
    take_result(a, x);
    result->rho = a->rho;
    result->objective = a->linear.forward ? admm_normal_misfit(a, b, x)
                                          : admm_blur_misfit(a, b, x);
    for (size_t i = 0; i < a->n; i++)
        sum += (double)x[i];
    result->objective += l1 * sum + (tv > 0.0 ? tv * total_variation(a, x) : 0.0);
    result->objective *= scale2;
    result->l1_weight = l1 * a->scale * a->gain;
    result->tv_weight = tv * a->scale * a->gain;
    for (size_t i = 0; i < a->n; i++)
        x[i] = (float)((double)x[i] * a->scale / a->gain);
}

void admm_solve(struct admm *a, const float *b, double reference, float *x,
                struct admm_result *result)
{
    struct admm_result unused;
    double largest, length;
    if (!result)
        result = &unused;
    memset(result, 0, sizeof *result);
    memset(x, 0, a->n * sizeof *x);
    a->scale = largest_of(b, a->linear.forward ? a->linear.n_data : a->n);
    if (!(a->scale >= FLT_MIN)) { /* silence */
        result->converged = true;
        return;
    }
    if (!a->linear.forward)
        admm_blur_begin(a, b);
    else
        admm_normal_begin(a, b);
    survey(a, &largest, &length);
    double unit = reference > 0.0 ? reference / (a->scale * a->gain) : largest;
    if (largest <= a->cfg.l1 * unit) { /* then 0 satisfies the optimum's conditions */
        result->converged = true;
        return;
    }
    a->rho = a->cfg.rho;
    a->kappa[0] = (float)(a->cfg.l1 * unit / a->rho);
    a->kappa[1] = (float)(a->cfg.tv * unit / a->rho);
    for (size_t d = 0; d < a->parts; d++)
        memset(a->v[0][d], 0, a->nz * a->plane * sizeof(float));
    iterate(a, length, result);
    finish(a, b, x, result);
}
