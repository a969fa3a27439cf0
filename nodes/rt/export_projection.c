/* SPDX-License-Identifier: MIT */
#include "nodes/rt/export_projection.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static float greater(float a, float b)
{
    return a > b ? a : b;
}

/* out[x * stride] = the greater of it and row[x]; strides 0 and 1 are what volumes of
 * hundreds of MB are projected with, and vector code can do those. */
static void fold_row(const float *restrict row, size_t n, float *restrict out,
                     size_t stride)
{
    if (stride == 1) {
        for (size_t x = 0; x < n; x++)
            out[x] = greater(row[x], out[x]);
    } else if (stride == 0) {
        float lane[8] = {0.0f}, most = *out;
        size_t x = 0;
        for (; x + 8 <= n; x += 8)
            for (size_t k = 0; k < 8; k++)
                lane[k] = greater(row[x + k], lane[k]);
        for (; x < n; x++)
            most = greater(row[x], most);
        for (size_t k = 0; k < 8; k++)
            most = greater(lane[k], most);
        *out = most;
    } else {
        for (size_t x = 0; x < n; x++)
            out[x * stride] = greater(row[x], out[x * stride]);
    }
}

int projection_create(struct projection *out, const struct grid *grid,
                      const float *volume, int across, int up)
{
    const int axis[2] = {across, up};
    size_t stride[3] = {0}; /* of the volume's axes in the picture */

    memset(out, 0, sizeof *out);
    for (int i = 0; i < 2; i++) {
        out->axis[i] = axis[i];
        out->n[i] = grid->n[axis[i]];
        out->origin_m[i] = grid->origin_m[axis[i]];
        out->step_m[i] = grid->step_m[axis[i]];
    }
    stride[across] = 1;
    stride[up] = out->n[0];
    out->value = calloc(out->n[0] * out->n[1], sizeof *out->value);
    if (!out->value)
        return -ENOMEM;
    for (size_t z = 0; z < grid->n[2]; z++) {
        for (size_t y = 0; y < grid->n[1]; y++) {
            const float *row = volume + (z * grid->n[1] + y) * grid->n[0];
            fold_row(row, grid->n[0], out->value + z * stride[2] + y * stride[1],
                     stride[0]);
        }
    }
    return 0;
}

/* Where a pixel's centre lies among the samples of an axis. */
struct taps {
    size_t index[4]; /* held inside */
    float weight[4]; /* Catmull-Rom */
};

static struct taps *taps_create(size_t n_samples, size_t n_pixels)
{
    struct taps *all = malloc(n_pixels * sizeof *all);
    double last = (double)n_samples - 1.0;
    for (size_t k = 0; all && k < n_pixels; k++) {
        double at = ((double)k + 0.5) * (double)n_samples / (double)n_pixels - 0.5;
        at = fmin(fmax(at, 0.0), last);
        double t = at - floor(at);
        const double w[4] = {
            t * (-0.5 + t * (1.0 - 0.5 * t)),
            1.0 + t * t * (1.5 * t - 2.5),
            t * (0.5 + t * (2.0 - 1.5 * t)),
            t * t * (0.5 * t - 0.5),
        };
        for (int i = 0; i < 4; i++) {
            all[k].index[i] = (size_t)fmin(fmax(floor(at) - 1.0 + i, 0.0), last);
            all[k].weight[i] = (float)w[i];
        }
    }
    return all;
}

static void widen_row(const float *row, const struct taps *taps, size_t w, float *out)
{
    for (size_t c = 0; c < w; c++) {
        const struct taps *t = &taps[c];
        out[c] = t->weight[0] * row[t->index[0]] + t->weight[1] * row[t->index[1]] +
                 t->weight[2] * row[t->index[2]] + t->weight[3] * row[t->index[3]];
    }
}

int projection_resample(const struct projection *p, size_t w, size_t h, float *out)
{
    struct taps *across = taps_create(p->n[0], w), *up = taps_create(p->n[1], h);
    float *wide = malloc(p->n[1] * w * sizeof *wide); /* [n[1]][w] */
    int err = across && up && wide ? 0 : -ENOMEM;

    for (size_t r = 0; !err && r < p->n[1]; r++)
        widen_row(p->value + r * p->n[0], across, w, wide + r * w);
    for (size_t r = 0; !err && r < h; r++) {
        const struct taps *t = &up[h - 1 - r];
        const float *in[4];
        for (int i = 0; i < 4; i++)
            in[i] = wide + t->index[i] * w;
        for (size_t c = 0; c < w; c++) {
            float v = t->weight[0] * in[0][c] + t->weight[1] * in[1][c] +
                      t->weight[2] * in[2][c] + t->weight[3] * in[3][c];
            out[r * w + c] = v > 0.0f ? v : 0.0f;
        }
    }
    free(wide);
    free(up);
    free(across);
    return err;
}

void projection_edges(const struct projection *p, int axis, double *min, double *max)
{
    *min = p->origin_m[axis] - 0.5 * p->step_m[axis];
    *max = *min + (double)p->n[axis] * p->step_m[axis];
}

void projection_clear(struct projection *p)
{
    free(p->value);
    memset(p, 0, sizeof *p);
}
