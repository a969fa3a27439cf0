#include "nodes/rt/export_projection.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

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
            float *p = out->value + z * stride[2] + y * stride[1];
            for (size_t x = 0; x < grid->n[0]; x++)
                if (row[x] > p[x * stride[0]])
                    p[x * stride[0]] = row[x];
        }
    }
    return 0;
}

static void catmull_rom(double t, double w[4])
{
    w[0] = t * (-0.5 + t * (1.0 - 0.5 * t));
    w[1] = 1.0 + t * t * (1.5 * t - 2.5);
    w[2] = t * (0.5 + t * (2.0 - 1.5 * t));
    w[3] = t * t * (0.5 * t - 0.5);
}

/* Indices of the four samples around a point, held inside, and their weights. */
static void locate(const struct projection *p, int axis, double at_m, size_t index[4],
                   double w[4])
{
    double last = (double)p->n[axis] - 1.0;
    double at = fmin(fmax((at_m - p->origin_m[axis]) / p->step_m[axis], 0.0), last);
    double before = floor(at);
    for (int i = 0; i < 4; i++)
        index[i] = (size_t)fmin(fmax(before - 1.0 + i, 0.0), last);
    catmull_rom(at - before, w);
}

double projection_at(const struct projection *p, double across_m, double up_m)
{
    size_t ix[4], iy[4];
    double wx[4], wy[4], sum = 0.0;
    locate(p, 0, across_m, ix, wx);
    locate(p, 1, up_m, iy, wy);
    for (int j = 0; j < 4; j++) {
        const float *row = p->value + iy[j] * p->n[0];
        for (int i = 0; i < 4; i++)
            sum += wy[j] * wx[i] * (double)row[ix[i]];
    }
    return fmax(sum, 0.0);
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
