/* SPDX-License-Identifier: MIT */
/* recon/inverse/admm_normal.c -- the step of an operator that no transform diagonalises:
 * towards M x = K'b + rho R, M = K'K + rho (1 + D'D), with one product by K'K.  The
 * residual, preconditioned with a blur like K'K, is a new direction; the minimum over it
 * and those of the iterations before (recon/inverse/admm_subspace) is worth three or four
 * steps of conjugate gradients that restart. */
#include "recon/inverse/admm_plan.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "recon/inverse/admm_subspace.h"

#define POWER_STEPS 12 /* of the power method for |K|^2 */

static void apply(struct admm *a, const float *x, float *out)
{
    a->linear.forward(a->linear.ctx, x, a->measured);
    a->linear.adjoint(a->linear.ctx, a->measured, out);
}

static double dot(const float *x, const float *y, size_t n)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += (double)x[i] * (double)y[i];
    return sum;
}

/* Power method from a start that no symmetry of K hides from. */
static void measure_gain(struct admm *a)
{
    float *in = a->residual, *out = a->ahead;
    uint32_t seed = 1;
    for (size_t i = 0; i < a->n; i++) {
        seed = seed * 1664525u + 1013904223u;
        in[i] = 0.5f + (float)(seed >> 8) / 16777216.0f;
    }
    a->gain = 1.0;
    for (int step = 0; step < POWER_STEPS && !pool_stopped(a->cfg.pool); step++) {
        apply(a, in, out);
        double norm = sqrt(dot(out, out, a->n));
        a->gain = norm / sqrt(dot(in, in, a->n));
        if (!(norm > 0.0) || !isfinite(norm)) {
            a->gain = 1.0;
            return;
        }
        for (size_t i = 0; i < a->n; i++)
            in[i] = (float)(out[i] / norm);
    }
    a->gain = sqrt(a->gain); /* of K, like a blur's */
}

/* The response to a point in the middle, as if it were the same everywhere, is what
 * residuals are preconditioned with: |F| of it, so that it is positive. */
static void measure_response(struct admm *a)
{
    size_t middle = (a->nz / 2 * a->ny + a->ny / 2) * a->nx + a->nx / 2;
    memset(a->residual, 0, a->n * sizeof *a->residual);
    a->residual[middle] = 1.0f;
    apply(a, a->residual, a->ahead);
    for (size_t i = 0; i < a->n; i++)
        a->ahead[i] /= (float)(a->gain * a->gain);
    admm_blur_power(a, a->ahead);
}

int admm_normal_create(struct admm *a)
{
    float **const volumes[] = {&a->rhs, &a->kb, &a->mx, &a->residual, &a->ahead};
    for (size_t v = 0; v < sizeof volumes / sizeof *volumes; v++)
        if (!(*volumes[v] = calloc(a->n, sizeof(float))))
            return -ENOMEM;
    a->measured = calloc(a->linear.n_data, sizeof *a->measured);
    if (!a->measured)
        return -ENOMEM;
    int err = admm_subspace_create(&a->subspace, a->n, a->cfg.pool);
    if (err)
        return err;
    measure_gain(a);
    measure_response(a);
    return 0;
}

void admm_normal_destroy(struct admm *a)
{
    free(a->rhs);
    free(a->kb);
    free(a->mx);
    free(a->residual);
    free(a->ahead);
    free(a->measured);
    admm_subspace_destroy(a->subspace);
}

/* K'K in units of |K|^2. */
static void apply_normal(struct admm *a, const float *x, float *out)
{
    float gain2 = (float)(1.0 / (a->gain * a->gain));
    apply(a, x, out);
    for (size_t i = 0; i < a->n; i++)
        out[i] *= gain2;
}

void admm_normal_begin(struct admm *a, const float *b)
{
    for (size_t i = 0; i < a->linear.n_data; i++)
        a->measured[i] = b[i] / (float)a->scale;
    a->linear.adjoint(a->linear.ctx, a->measured, a->kb);
    for (size_t i = 0; i < a->n; i++)
        a->kb[i] /= (float)a->gain;
    memcpy(a->x, a->kb, a->n * sizeof *a->x);
    apply_normal(a, a->x, a->mx);
    a->mx_rho = 0.0;
    admm_subspace_clear(a->subspace);
}

VECTOR_CLONES
static void add_plane(size_t n, const float *restrict kb, const float *restrict plane,
                      float rho, float *restrict rhs)
{
    for (size_t i = 0; i < n; i++)
        rhs[i] = kb[i] + rho * plane[i];
}

void admm_normal_emit(struct admm *a, size_t z, size_t thread)
{
    add_plane(a->plane, a->kb + z * a->plane, a->scratch[thread].plane, (float)a->rho,
              a->rhs + z * a->plane);
}

/* -- rho (1 + D'D) ----------------------------------------------------------------------
 */

/* out row += rho (1 + D'D) in; the neighbours of a rim are the rim. */
VECTOR_CLONES
static void smooth_row(size_t n, const float *restrict in, const float *restrict low_y,
                       const float *restrict high_y, const float *restrict low_z,
                       const float *restrict high_z, float rho, float laplace,
                       float *restrict out)
{
    for (size_t i = 0; i < n; i++) {
        float around = low_y[i] + high_y[i] + low_z[i] + high_z[i] - 4.0f * in[i];
        out[i] += rho * (in[i] - laplace * around);
    }
    for (size_t i = 0; i + 1 < n; i++) {
        float step = rho * laplace * (in[i + 1] - in[i]);
        out[i] -= step;
        out[i + 1] += step;
    }
}

struct smoothing {
    const struct admm *a;
    const float *in;
    float *out;
    double rho;
};

static void smooth_plane(void *ctx, size_t z, size_t thread)
{
    const struct smoothing *s = ctx;
    const struct admm *a = s->a;
    (void)thread;
    for (size_t y = 0; y < a->ny; y++) {
        const float *row = s->in + z * a->plane + y * a->nx;
        smooth_row(a->nx, row, y ? row - a->nx : row, y + 1 < a->ny ? row + a->nx : row,
                   z ? row - a->plane : row, z + 1 < a->nz ? row + a->plane : row,
                   (float)s->rho, a->parts > 1 ? 1.0f : 0.0f,
                   s->out + z * a->plane + y * a->nx);
    }
}

/* out += rho (1 + D'D) in */
static void smooth(struct admm *a, const float *in, double rho, float *out)
{
    struct smoothing s = {a, in, out, rho};
    pool_run(a->cfg.pool, a->nz, smooth_plane, &s);
}

/* M x and M p for another rho, without K. */
static void renew(struct admm *a)
{
    double rise = a->rho - a->mx_rho;
    smooth(a, a->x, rise, a->mx);
    for (size_t i = 0; i < admm_subspace_count(a->subspace); i++) {
        struct admm_direction d = admm_subspace_at(a->subspace, i);
        smooth(a, d.p, rise, d.mp);
    }
    admm_subspace_renew(a->subspace);
    a->mx_rho = a->rho;
}

/* -- the step ---------------------------------------------------------------------------
 */

static void residual_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    (void)thread;
    for (size_t i = z * a->plane; i < (z + 1) * a->plane; i++)
        a->residual[i] = a->rhs[i] - a->mx[i];
}

static void precondition_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    memcpy(a->scratch[thread].plane, a->residual + z * a->plane,
           a->plane * sizeof *a->residual);
    admm_blur_emit(a, z, thread);
}

void admm_normal_update(struct admm *a)
{
    if (a->rho != a->mx_rho)
        renew(a);
    pool_run(a->cfg.pool, a->nz, residual_plane, a);
    admm_subspace_descend(a->subspace, a->residual, a->x, a->mx);
    struct admm_direction d = admm_subspace_next(a->subspace);
    pool_run(a->cfg.pool, a->nz, precondition_plane, a);
    a->target = d.p;
    admm_blur_precondition(a);
    apply_normal(a, d.p, d.mp);
    smooth(a, d.p, a->rho, d.mp);
    admm_subspace_keep(a->subspace);
    admm_subspace_descend(a->subspace, a->residual, a->x, a->mx);
}

double admm_normal_misfit(struct admm *a, const float *b, const float *x)
{
    double sum = 0.0;
    a->linear.forward(a->linear.ctx, x, a->measured);
    for (size_t i = 0; i < a->linear.n_data; i++)
        sum += pow(a->measured[i] / a->gain - b[i] / a->scale, 2.0);
    return 0.5 * sum;
}
