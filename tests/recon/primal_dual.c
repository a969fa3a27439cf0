/* SPDX-License-Identifier: MIT */
#include "tests/recon/primal_dual.h"

#include <math.h>
#include <string.h>

#define N_MAX PRIMAL_DUAL_MAX
#define RATIO 6.0 /* of the steps of x to that without */

static size_t behind(const struct primal_dual *p, size_t i, int axis)
{
    size_t at[3] = {i % p->n[0], i / p->n[0] % p->n[1], i / (p->n[0] * p->n[1])};
    if (at[axis] + 1 == p->n[axis] && !p->wrap)
        return i;
    at[axis] = (at[axis] + 1) % p->n[axis];
    return (at[2] * p->n[1] + at[1]) * p->n[0] + at[0];
}

void primal_dual_forward(const struct primal_dual *p, const double *x, double *y)
{
    for (size_t r = 0; r < p->n_data; r++) {
        y[r] = 0.0;
        for (size_t i = 0; i < p->size; i++)
            y[r] += p->k[r * p->size + i] * x[i];
    }
}

void primal_dual_adjoint(const struct primal_dual *p, const double *y, double *x)
{
    memset(x, 0, p->size * sizeof *x);
    for (size_t r = 0; r < p->n_data; r++)
        for (size_t i = 0; i < p->size; i++)
            x[i] += p->k[r * p->size + i] * y[r];
}

double primal_dual_objective(const struct primal_dual *p, const double *x)
{
    double y[N_MAX], sum = 0.0;
    primal_dual_forward(p, x, y);
    for (size_t r = 0; r < p->n_data; r++)
        sum += 0.5 * pow(y[r] - p->b[r], 2.0);
    for (size_t i = 0; i < p->size; i++) {
        double d[3];
        for (int a = 0; a < 3; a++)
            d[a] = x[behind(p, i, a)] - x[i];
        sum += p->l1 * fabs(x[i]);
        sum += p->tv * (p->isotropic ? sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                                     : fabs(d[0]) + fabs(d[1]) + fabs(d[2]));
    }
    return sum;
}

static void shrink_dual(const struct primal_dual *p, double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int a = 0; a < 3; a++)
        v[a] = p->isotropic ? v[a] / fmax(1.0, length / p->tv)
                            : fmin(fmax(v[a], -p->tv), p->tv);
}

/* |K| <= 1 and |D|^2 <= 12: steps whose product is 1 / 13, longer where x is. */
void primal_dual_solve(const struct primal_dual *p, size_t iterations, double *x)
{
    double step = 0.99 * RATIO / sqrt(13.0), rise = 0.99 / RATIO / sqrt(13.0), y[N_MAX];
    double u[N_MAX] = {0}, ahead[N_MAX] = {0};
    static double v[N_MAX][3];
    memset(v, 0, sizeof v);
    memset(x, 0, p->size * sizeof *x);
    for (size_t round = 0; round < iterations; round++) {
        double down[N_MAX];
        primal_dual_forward(p, ahead, y);
        for (size_t r = 0; r < p->n_data; r++)
            u[r] = (u[r] + rise * (y[r] - p->b[r])) / (1.0 + rise);
        for (size_t i = 0; p->tv > 0.0 && i < p->size; i++) {
            for (int a = 0; a < 3; a++)
                v[i][a] += rise * (ahead[behind(p, i, a)] - ahead[i]);
            shrink_dual(p, v[i]);
        }
        primal_dual_adjoint(p, u, down);
        for (size_t i = 0; i < p->size; i++)
            for (int a = 0; a < 3; a++) {
                down[behind(p, i, a)] += v[i][a];
                down[i] -= v[i][a];
            }
        for (size_t i = 0; i < p->size; i++) {
            double next = fmax(x[i] - step * (down[i] + p->l1), 0.0);
            ahead[i] = 2.0 * next - x[i];
            x[i] = next;
        }
    }
}

/* The response to a point at voxel 0. */
static void point_response(const struct primal_dual *p, const double c[6], double *kernel)
{
    for (size_t d = 0; d < p->size; d++) {
        size_t at[3] = {d % p->n[0], d / p->n[0] % p->n[1], d / (p->n[0] * p->n[1])};
        kernel[d] = 0.0;
        for (size_t k = 0; k < p->size; k++) {
            size_t f[3] = {k % p->n[0], k / p->n[0] % p->n[1], k / (p->n[0] * p->n[1])};
            double w[3], phase = 0.0;
            for (int a = 0; a < 3; a++) {
                double turns = (double)f[a] / (double)p->n[a];
                w[a] = 2.0 * M_PI * (turns > 0.5 ? turns - 1.0 : turns);
                phase += w[a] * (double)at[a];
            }
            double form =
                c[0] * w[0] * w[0] + c[3] * w[1] * w[1] + c[5] * w[2] * w[2] +
                2.0 * (c[1] * w[0] * w[1] + c[2] * w[0] * w[2] + c[4] * w[1] * w[2]);
            kernel[d] += exp(-0.5 * form) * cos(phase) / (double)p->size;
        }
    }
}

void primal_dual_blur(struct primal_dual *p, const double covariance[6])
{
    double kernel[N_MAX];
    const size_t stride[3] = {1, p->n[0], p->n[0] * p->n[1]};
    point_response(p, covariance, kernel);
    for (size_t r = 0; r < p->size; r++)
        for (size_t i = 0; i < p->size; i++) {
            size_t apart = 0;
            for (int a = 0; a < 3; a++)
                apart += (r / stride[a] % p->n[a] + p->n[a] - i / stride[a] % p->n[a]) %
                         p->n[a] * stride[a];
            p->k[r * p->size + i] = kernel[apart];
        }
}
