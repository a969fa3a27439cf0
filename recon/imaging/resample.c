/* SPDX-License-Identifier: MIT */
#include "recon/imaging/resample.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"

#define TAPS  4
#define SLACK 1e-6 /* steps that a voxel may lie outside and still be on the rim */

struct taps { /* one new coordinate among old ones; all weights 0: outside */
    uint32_t at[TAPS];
    float weight[TAPS];
};

struct resample {
    struct grid from, to;
    struct pool *pool;
    struct taps *taps[3];
    float *scratch; /* [threads]: a plane [from ny][from nx], one [from ny][to nx] */
    size_t scratch_size;
    const float *in;
    float *out;
};

static void weigh(enum resample_way way, double f, float w[TAPS])
{
    if (way == RESAMPLE_LINEAR) {
        w[1] = (float)(1.0 - f);
        w[2] = (float)f;
        return;
    }
    w[0] = (float)(0.5 * f * (-1.0 + f * (2.0 - f)));
    w[1] = (float)(1.0 + 0.5 * f * f * (-5.0 + 3.0 * f));
    w[2] = (float)(0.5 * f * (1.0 + f * (4.0 - 3.0 * f)));
    w[3] = (float)(0.5 * f * f * (f - 1.0));
}

static void plan_taps(struct taps *t, enum resample_way way, double at, size_t n)
{
    double last = (double)(n - 1);
    memset(t, 0, sizeof *t);
    if (n == 1) {
        t->weight[1] = fabs(at) <= 0.5 + SLACK ? 1.0f : 0.0f;
        return;
    }
    if (!(at >= -SLACK && at <= last + SLACK))
        return;
    at = fmin(fmax(at, 0.0), last);
    double below = fmin(floor(at), last - 1.0);
    for (int q = 0; q < TAPS; q++) /* the rim stands for what is beyond it */
        t->at[q] = (uint32_t)fmin(fmax(below + q - 1, 0.0), last);
    weigh(way, at - below, t->weight);
}

static int plan_axis(struct resample *r, int a, enum resample_way way)
{
    r->taps[a] = malloc(r->to.n[a] * sizeof *r->taps[a]);
    if (!r->taps[a])
        return -ENOMEM;
    for (size_t i = 0; i < r->to.n[a]; i++) {
        double at_m = r->to.origin_m[a] + (double)i * r->to.step_m[a];
        plan_taps(&r->taps[a][i], way, (at_m - r->from.origin_m[a]) / r->from.step_m[a],
                  r->from.n[a]);
    }
    return 0;
}

static bool sensible(const struct grid *g)
{
    bool ok = grid_size(g) > 0;
    for (int a = 0; a < 3; a++)
        ok = ok && g->step_m[a] > 0.0 && isfinite(g->step_m[a]) &&
             isfinite(g->origin_m[a]);
    return ok;
}

int resample_create(struct resample **out, const struct grid *from, const struct grid *to,
                    enum resample_way way, struct pool *pool)
{
    if (!sensible(from) || !sensible(to) || !pool)
        return -EINVAL;
    struct resample *r = calloc(1, sizeof *r);
    if (!r)
        return -ENOMEM;
    r->from = *from;
    r->to = *to;
    r->pool = pool;
    r->scratch_size = from->n[1] * (from->n[0] + to->n[0]);
    r->scratch = malloc(pool_threads(pool) * r->scratch_size * sizeof *r->scratch);
    int err = r->scratch ? 0 : -ENOMEM;
    for (int a = 0; !err && a < 3; a++)
        err = plan_axis(r, a, way);
    if (err) {
        resample_destroy(r);
        return err;
    }
    *out = r;
    return 0;
}

/* Four rows or planes that lie apart by `stride`, to one. */
VECTOR_CLONES
static void blend(const float *in, size_t stride, const struct taps *t, size_t n,
                  float *restrict out)
{
    const float *a = in + t->at[0] * stride, *b = in + t->at[1] * stride;
    const float *c = in + t->at[2] * stride, *d = in + t->at[3] * stride;
    const float *w = t->weight;
    for (size_t i = 0; i < n; i++)
        out[i] = w[0] * a[i] + w[1] * b[i] + w[2] * c[i] + w[3] * d[i];
}

static void stretch_row(const float *in, const struct taps *taps, size_t n,
                        float *restrict out)
{
    for (size_t x = 0; x < n; x++) {
        const struct taps *t = &taps[x];
        float sum = 0.0f;
        for (int q = 0; q < TAPS; q++)
            sum += t->weight[q] * in[t->at[q]];
        out[x] = sum;
    }
}

static void resample_plane(void *ctx, size_t z, size_t thread)
{
    struct resample *r = ctx;
    const size_t *n = r->from.n, *m = r->to.n;
    const struct taps *t = &r->taps[2][z];
    float *plane = r->scratch + thread * r->scratch_size, *wide = plane + n[0] * n[1];
    float *out = r->out + z * m[0] * m[1];
    if (t->weight[1] == 0.0f && t->weight[2] == 0.0f) {
        memset(out, 0, m[0] * m[1] * sizeof *out);
        return;
    }
    blend(r->in, n[0] * n[1], t, n[0] * n[1], plane);
    for (size_t y = 0; y < n[1]; y++)
        stretch_row(plane + y * n[0], r->taps[0], m[0], wide + y * m[0]);
    for (size_t y = 0; y < m[1]; y++)
        blend(wide, m[0], &r->taps[1][y], m[0], out + y * m[0]);
}

void resample_volume(struct resample *r, const float *in, float *y)
{
    r->in = in;
    r->out = y;
    pool_run(r->pool, r->to.n[2], resample_plane, r);
}

void resample_destroy(struct resample *r)
{
    if (!r)
        return;
    for (int a = 0; a < 3; a++)
        free(r->taps[a]);
    free(r->scratch);
    free(r);
}
