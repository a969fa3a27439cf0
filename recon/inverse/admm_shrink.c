/* SPDX-License-Identifier: MIT */
#include "recon/inverse/admm_shrink.h"

#include <float.h>
#include <math.h>

#include "dsp/vector.h"

VECTOR_INLINE double squares(const float *x, size_t n)
{
    double sum = 0.0;
    float lanes[VECTOR_LANES] = {0};
    size_t i = 0;
    for (; i + VECTOR_LANES <= n; i += VECTOR_LANES)
        for (size_t l = 0; l < VECTOR_LANES; l++)
            lanes[l] += x[i + l] * x[i + l];
    for (size_t l = 0; l < VECTOR_LANES; l++)
        sum += (double)lanes[l];
    for (; i < n; i++)
        sum += (double)x[i] * (double)x[i];
    return sum;
}

VECTOR_CLONES
double admm_squares(const float *x, size_t n)
{
    return squares(x, n);
}

VECTOR_INLINE float soft(float v, float kappa)
{
    float low = v > kappa ? kappa : v;
    return v - (low < -kappa ? -kappa : low);
}

VECTOR_INLINE float soft_positive(float v, float kappa)
{
    return v > kappa ? v - kappa : 0.0f;
}

/* x >= 0 with its L1 weight, or a difference with its weight. */
VECTOR_INLINE void shrink_part(size_t n, const float *restrict ax,
                               const float *restrict before, float *restrict after,
                               float *restrict g, float relax, float kappa, int self)
{
    for (size_t i = 0; i < n; i++) {
        float z = self ? soft_positive(before[i], kappa) : soft(before[i], kappa);
        float v = before[i] + relax * (ax[i] - z);
        z = self ? soft_positive(v, kappa) : soft(v, kappa);
        after[i] = v;
        g[i] = 2.0f * z - v;
    }
}

/* 1 - kappa / |v|, not below 0; a threshold of 0 leaves even a zero as it is. */
VECTOR_INLINE float shorten(float x, float y, float z, float kappa)
{
    float length = sqrtf(x * x + y * y + z * z);
    float factor = 1.0f - kappa / (length > FLT_MIN ? length : FLT_MIN);
    return factor > 0.0f ? factor : 0.0f;
}

VECTOR_INLINE void shrink_gradient(const struct admm_part_row *p, size_t n, float relax,
                                   float kappa)
{
    const float *restrict xb = p[0].before, *restrict yb = p[1].before;
    const float *restrict zb = p[2].before, *restrict dx = p[0].ax;
    const float *restrict dy = p[1].ax, *restrict dz = p[2].ax;
    float *restrict xa = p[0].after, *restrict ya = p[1].after, *restrict za = p[2].after;
    float *restrict xg = p[0].g, *restrict yg = p[1].g, *restrict zg = p[2].g;
    for (size_t i = 0; i < n; i++) {
        float x = xb[i], y = yb[i], z = zb[i];
        float f = shorten(x, y, z, kappa);
        x += relax * (dx[i] - f * x);
        y += relax * (dy[i] - f * y);
        z += relax * (dz[i] - f * z);
        f = 2.0f * shorten(x, y, z, kappa) - 1.0f;
        xa[i] = x;
        ya[i] = y;
        za[i] = z;
        xg[i] = f * x;
        yg[i] = f * y;
        zg[i] = f * z;
    }
}

/* What the stopping rule looks at, from v and g = 2 z - v. */
VECTOR_INLINE void compare_part(size_t n, const float *restrict ax,
                                const float *restrict after, const float *restrict g,
                                float *restrict z, float *restrict dual,
                                float *restrict gap)
{
    for (size_t i = 0; i < n; i++) {
        z[i] = 0.5f * (g[i] + after[i]);
        dual[i] = after[i] - z[i];
        gap[i] = ax[i] - z[i];
    }
}

/* change = z - the z before. */
VECTOR_INLINE void change_part(size_t n, const float *restrict before,
                               const float *restrict z, float *restrict change,
                               float kappa, int self)
{
    for (size_t i = 0; i < n; i++)
        change[i] = z[i] -
                    (self ? soft_positive(before[i], kappa) : soft(before[i], kappa));
}

static void change_gradient(const struct admm_part_row *p, size_t n, float kappa)
{
    for (size_t i = 0; i < n; i++) {
        float f = shorten(p[0].before[i], p[1].before[i], p[2].before[i], kappa);
        for (int d = 0; d < 3; d++)
            p[d].change[i] = p[d].z[i] - f * p[d].before[i];
    }
}

VECTOR_CLONES
void admm_shrink_row(const struct admm *a, const struct admm_part_row *p)
{
    float relax = (float)a->cfg.relaxation;
    shrink_part(a->nx, p->ax, p->before, p->after, p->g, relax, a->kappa[0], 1);
    if (a->parts > 1 && a->cfg.tv_isotropic) {
        shrink_gradient(p + 1, a->nx, relax, a->kappa[1]);
        return;
    }
    for (size_t d = 1; d < a->parts; d++)
        shrink_part(a->nx, p[d].ax, p[d].before, p[d].after, p[d].g, relax, a->kappa[1],
                    0);
}

VECTOR_CLONES
void admm_compare_row(const struct admm *a, const struct admm_part_row *p,
                      struct admm_norms *norms)
{
    bool gradient = a->parts > 1 && a->cfg.tv_isotropic;
    for (size_t d = 0; d < a->parts; d++) {
        compare_part(a->nx, p[d].ax, p[d].after, p[d].g, p[d].z, p[d].dual, p[d].gap);
        norms->gap += squares(p[d].gap, a->nx);
        norms->ax += squares(p[d].ax, a->nx);
        norms->z += squares(p[d].z, a->nx);
        if (d == ADMM_SELF)
            change_part(a->nx, p->before, p->z, p->change, a->kappa[0], 1);
        else if (!gradient)
            change_part(a->nx, p[d].before, p[d].z, p[d].change, a->kappa[1], 0);
    }
    if (gradient)
        change_gradient(p + 1, a->nx, a->kappa[1]);
}

/* -- another rho ------------------------------------------------------------------------
 */

/* v = z + u, and rho u stays: v <- z + (v - z) / factor. */
VECTOR_CLONES
static void rescale(struct admm *a, size_t at, size_t n, float inverse)
{
    float *self = a->v[0][ADMM_SELF] + at;
    for (size_t i = 0; i < n; i++) {
        float z = self[i] - a->kappa[0] > 0.0f ? self[i] - a->kappa[0] : 0.0f;
        self[i] = z + inverse * (self[i] - z);
    }
    if (a->parts == 1)
        return;
    float *x = a->v[0][ADMM_X] + at, *y = a->v[0][ADMM_Y] + at, *w = a->v[0][ADMM_Z] + at;
    if (a->cfg.tv_isotropic) {
        for (size_t i = 0; i < n; i++) {
            float f = shorten(x[i], y[i], w[i], a->kappa[1]);
            float factor = f + inverse * (1.0f - f);
            x[i] *= factor;
            y[i] *= factor;
            w[i] *= factor;
        }
        return;
    }
    for (size_t d = ADMM_X; d < ADMM_PARTS; d++) {
        float *v = a->v[0][d] + at;
        for (size_t i = 0; i < n; i++) {
            float z = soft(v[i], a->kappa[1]);
            v[i] = z + inverse * (v[i] - z);
        }
    }
}

void admm_shrink_rescale(struct admm *a, double rho)
{
    float factor = (float)(rho / a->rho);
    for (size_t z = 0; z < a->nz; z++)
        rescale(a, z * a->plane, a->nx * a->ny, 1.0f / factor);
    a->kappa[0] /= factor;
    a->kappa[1] /= factor;
    a->rho = rho;
}
