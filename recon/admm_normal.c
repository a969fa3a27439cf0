/* recon/admm_normal.c -- the step of an operator that no transform diagonalises:
 * (K'K + rho (1 + D'D)) x = K'b + rho R by conjugate gradients.  Each iteration goes on
 * where the last one stopped, with a direction conjugate to the last (Polak and Ribiere
 * 1969; the right-hand side moves little), so that one product with K'K is enough. */
#include "recon/admm_plan.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

#define POWER_STEPS 12 /* of the power method for |K|^2 */

static void apply(struct admm *a, const float *x, float *out)
{
    a->operator.forward(a->operator.ctx, x, a->measured);
    a->operator.adjoint(a->operator.ctx, a->measured, out);
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

int admm_normal_create(struct admm *a)
{
    float **const volumes[] = {&a->rhs,      &a->kb,        &a->kkx,
                               &a->residual, &a->direction, &a->kkd};
    for (size_t v = 0; v < sizeof volumes / sizeof *volumes; v++)
        if (!(*volumes[v] = calloc(a->n, sizeof(float))))
            return -ENOMEM;
    a->measured = calloc(a->operator.n_data, sizeof *a->measured);
    a->sums = calloc(a->nz, sizeof *a->sums);
    if (!a->measured || !a->sums)
        return -ENOMEM;
    measure_gain(a);
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
    free(a->measured);
    free(a->sums);
}

void admm_normal_begin(struct admm *a, const float *b)
{
    float gain2 = (float)(1.0 / (a->gain * a->gain));
    for (size_t i = 0; i < a->operator.n_data; i++)
        a->measured[i] = b[i] / (float)a->scale;
    a->operator.adjoint(a->operator.ctx, a->measured, a->kb);
    for (size_t i = 0; i < a->n; i++)
        a->kb[i] /= (float)a->gain;
    memcpy(a->x, a->kb, a->n * sizeof *a->x);
    apply(a, a->x, a->kkx);
    for (size_t i = 0; i < a->n; i++)
        a->kkx[i] *= gain2;
    memset(a->direction, 0, a->n * sizeof *a->direction);
    a->residual2 = 0.0;
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

/* residual = rhs - M x; sums: with the new one, with the one before. */
static void residual_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    struct admm_scratch *s = &a->scratch[thread];
    double *sum = a->sums[z];
    sum[0] = sum[1] = 0.0;
    for (size_t y = 0; y < a->ny; y++) {
        size_t at = z * a->plane + y * a->nx;
        smooth(a, a->x, z, y, s->plane);
        for (size_t i = 0; i < a->nx; i++) {
            float r = a->rhs[at + i] - a->kkx[at + i] - s->plane[i];
            sum[0] += (double)r * (double)r;
            sum[1] += (double)r * (double)a->residual[at + i];
            a->residual[at + i] = r;
        }
    }
}

/* sums: direction with residual, with M direction. */
static void curvature_plane(void *ctx, size_t z, size_t thread)
{
    struct admm *a = ctx;
    struct admm_scratch *s = &a->scratch[thread];
    float gain2 = (float)(1.0 / (a->gain * a->gain));
    double *sum = a->sums[z];
    sum[0] = sum[1] = 0.0;
    for (size_t y = 0; y < a->ny; y++) {
        size_t at = z * a->plane + y * a->nx;
        smooth(a, a->direction, z, y, s->plane);
        for (size_t i = 0; i < a->nx; i++) {
            a->kkd[at + i] *= gain2;
            float d = a->direction[at + i], md = a->kkd[at + i] + s->plane[i];
            sum[0] += (double)d * (double)a->residual[at + i];
            sum[1] += (double)d * (double)md;
        }
    }
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
static void turn(size_t n, const float *restrict residual, float keep,
                 float *restrict direction)
{
    for (size_t i = 0; i < n; i++)
        direction[i] = residual[i] + keep * direction[i];
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

void admm_normal_update(struct admm *a)
{
    double sum[2];
    sum_planes(a, residual_plane, sum);
    double keep =
        a->residual2 > 0.0 ? fmin(fmax((sum[0] - sum[1]) / a->residual2, 0.0), 1.0) : 0.0;
    a->residual2 = sum[0];
    turn(a->n, a->residual, (float)keep, a->direction);
    apply(a, a->direction, a->kkd);
    sum_planes(a, curvature_plane, sum);
    if (sum[1] > 0.0 && isfinite(sum[0] / sum[1]))
        advance(a->n, (float)(sum[0] / sum[1]), a->direction, a->kkd, a->x, a->kkx);
}

double admm_normal_misfit(struct admm *a, const float *b, const float *x)
{
    double sum = 0.0;
    a->operator.forward(a->operator.ctx, x, a->measured);
    for (size_t i = 0; i < a->operator.n_data; i++)
        sum += pow(a->measured[i] / a->gain - b[i] / a->scale, 2.0);
    return 0.5 * sum;
}
