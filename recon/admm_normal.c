/* recon/admm_normal.c -- the step of an operator that no transform diagonalises: towards
 * (K'K + rho (1 + D'D)) x = K'b + rho R by conjugate gradients (Hestenes 1952) that begin
 * where the last iteration ended, preconditioned with a blur like K'K: a step or two are
 * enough. */
#include "recon/admm_plan.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

#define LONG_EVERY  2  /* every second update takes ... */
#define LONG_STEPS  2  /* ... steps, the others one */
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
    uint32_t seed = 1;
    for (size_t i = 0; i < a->n; i++) {
        seed = seed * 1664525u + 1013904223u;
        a->direction[i] = 0.5f + (float)(seed >> 8) / 16777216.0f;
    }
    a->gain = 1.0;
    for (int step = 0; step < POWER_STEPS; step++) {
        apply(a, a->direction, a->kkd);
        double norm = sqrt(dot(a->kkd, a->kkd, a->n));
        a->gain = norm / sqrt(dot(a->direction, a->direction, a->n));
        if (!(norm > 0.0) || !isfinite(norm)) {
            a->gain = 1.0;
            return;
        }
        for (size_t i = 0; i < a->n; i++)
            a->direction[i] = (float)(a->kkd[i] / norm);
    }
    a->gain = sqrt(a->gain); /* of K, like a blur's */
}

/* The response to a point in the middle, as if it were the same everywhere, is what
 * conjugate gradients are preconditioned with: |F| of it, so that it is positive. */
static void measure_response(struct admm *a)
{
    size_t middle = (a->nz / 2 * a->ny + a->ny / 2) * a->nx + a->nx / 2;
    memset(a->direction, 0, a->n * sizeof *a->direction);
    a->direction[middle] = 1.0f;
    apply(a, a->direction, a->kkd);
    for (size_t i = 0; i < a->n; i++)
        a->kkd[i] /= (float)(a->gain * a->gain);
    admm_blur_power(a, a->kkd);
}

int admm_normal_create(struct admm *a)
{
    float **const volumes[] = {&a->rhs,       &a->kb,  &a->kkx,  &a->residual,
                               &a->direction, &a->kkd, &a->ahead};
    for (size_t v = 0; v < sizeof volumes / sizeof *volumes; v++)
        if (!(*volumes[v] = calloc(a->n, sizeof(float))))
            return -ENOMEM;
    a->measured = calloc(a->linear.n_data, sizeof *a->measured);
    a->sums = calloc(a->nz, sizeof *a->sums);
    if (!a->measured || !a->sums)
        return -ENOMEM;
    measure_gain(a);
    measure_response(a);
    return 0;
}

void admm_normal_destroy(struct admm *a)
{
    free(a->rhs);
    free(a->kb);
    free(a->kkx);
    free(a->residual);
    free(a->direction);
    free(a->kkd);
    free(a->ahead);
    free(a->measured);
    free(a->sums);
}

void admm_normal_begin(struct admm *a, const float *b)
{
    float gain2 = (float)(1.0 / (a->gain * a->gain));
    for (size_t i = 0; i < a->linear.n_data; i++)
        a->measured[i] = b[i] / (float)a->scale;
    a->linear.adjoint(a->linear.ctx, a->measured, a->kb);
    for (size_t i = 0; i < a->n; i++)
        a->kb[i] /= (float)a->gain;
    memcpy(a->x, a->kb, a->n * sizeof *a->x);
    apply(a, a->x, a->kkx);
    for (size_t i = 0; i < a->n; i++)
        a->kkx[i] *= gain2;
    memset(a->direction, 0, a->n * sizeof *a->direction);
    a->updates = 0;
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

/* out row = rho (1 + D'D) in; the neighbours of a rim are the rim. */
VECTOR_CLONES
static void smooth_row(size_t n, const float *restrict in, const float *restrict low_y,
                       const float *restrict high_y, const float *restrict low_z,
                       const float *restrict high_z, float rho, float laplace,
                       float *restrict out)
{
    for (size_t i = 0; i < n; i++) {
        float around = low_y[i] + high_y[i] + low_z[i] + high_z[i] - 4.0f * in[i];
        out[i] = rho * (in[i] - laplace * around);
    }
    for (size_t i = 0; i + 1 < n; i++) {
        float step = rho * laplace * (in[i + 1] - in[i]);
        out[i] -= step;
        out[i + 1] += step;
    }
}

static void smooth(const struct admm *a, const float *in, size_t z, size_t y, float *out)
{
    const float *row = in + z * a->plane + y * a->nx;
    smooth_row(a->nx, row, y ? row - a->nx : row, y + 1 < a->ny ? row + a->nx : row,
               z ? row - a->plane : row, z + 1 < a->nz ? row + a->plane : row,
               (float)a->rho, a->parts > 1 ? 1.0f : 0.0f, out);
}

/* residual = rhs - M x, and on to the preconditioner. */
static void residual_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    float *out = a->residual + z * a->plane;
    for (size_t y = 0; y < a->ny; y++) {
        float *row = out + y * a->nx;
        size_t at = z * a->plane + y * a->nx;
        smooth(a, a->x, z, y, row);
        for (size_t i = 0; i < a->nx; i++)
            row[i] = a->rhs[at + i] - a->kkx[at + i] - row[i];
    }
    memcpy(a->scratch[thread].plane, out, a->plane * sizeof *out);
    admm_blur_emit(a, z, thread);
}

/* Sums over a plane: residual times what the preconditioner makes of it. */
static void product_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    double sum = 0.0;
    (void)thread;
    for (size_t i = z * a->plane; i < (z + 1) * a->plane; i++)
        sum += (double)a->ahead[i] * (double)a->residual[i];
    a->sums[z][0] = sum;
    a->sums[z][1] = 0.0;
}

/* Sums: direction with residual, with M direction. */
static void curvature_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    float *row = a->scratch[thread].plane;
    float gain2 = (float)(1.0 / (a->gain * a->gain));
    double along = 0.0, own = 0.0;
    for (size_t y = 0; y < a->ny; y++) {
        size_t at = z * a->plane + y * a->nx;
        smooth(a, a->direction, z, y, row);
        for (size_t i = 0; i < a->nx; i++) {
            double d = a->direction[at + i];
            a->kkd[at + i] *= gain2;
            along += d * (double)a->residual[at + i];
            own += d * (double)(a->kkd[at + i] + row[i]);
        }
    }
    a->sums[z][0] = along;
    a->sums[z][1] = own;
}

static void sum_planes(struct admm *a, void (*work)(void *, size_t, size_t),
                       double sum[2])
{
    pool_run(a->cfg.pool, a->nz, work, a);
    sum[0] = sum[1] = 0.0;
    for (size_t z = 0; z < a->nz; z++) {
        sum[0] += a->sums[z][0];
        sum[1] += a->sums[z][1];
    }
}

VECTOR_CLONES
static void turn(size_t n, const float *restrict ahead, float keep,
                 float *restrict direction)
{
    for (size_t i = 0; i < n; i++)
        direction[i] = ahead[i] + keep * direction[i];
}

VECTOR_CLONES
static void advance(size_t n, float step, const float *restrict direction,
                    const float *restrict kkd, float *restrict x, float *restrict kkx)
{
    for (size_t i = 0; i < n; i++) {
        x[i] += step * direction[i];
        kkx[i] += step * kkd[i];
    }
}

/* Conjugate gradients begin anew each time: the right-hand side has moved, and a
 * direction kept from before makes the iterations swing. */
void admm_normal_update(struct admm *a)
{
    double sum[2], before = 0.0;
    size_t steps = ++a->updates % LONG_EVERY ? 1 : LONG_STEPS;
    a->target = a->ahead;
    for (size_t step = 0; step < steps; step++) {
        pool_run(a->cfg.pool, a->nz, residual_plane, a);
        admm_blur_precondition(a);
        sum_planes(a, product_plane, sum);
        double keep = before > 0.0 ? sum[0] / before : 0.0;
        before = sum[0];
        turn(a->n, a->ahead, (float)keep, a->direction);
        apply(a, a->direction, a->kkd);
        sum_planes(a, curvature_plane, sum);
        double length = sum[1] > 0.0 ? sum[0] / sum[1] : 0.0;
        if (isfinite(length))
            advance(a->n, (float)length, a->direction, a->kkd, a->x, a->kkx);
    }
}

double admm_normal_misfit(struct admm *a, const float *b, const float *x)
{
    double sum = 0.0;
    a->linear.forward(a->linear.ctx, x, a->measured);
    for (size_t i = 0; i < a->linear.n_data; i++)
        sum += pow(a->measured[i] / a->gain - b[i] / a->scale, 2.0);
    return 0.5 * sum;
}
