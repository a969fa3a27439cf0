/* SPDX-License-Identifier: MIT */
#include "nodes/view/picture.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/vector.h"
#include "nodes/rt/export_projection.h"

#define LEVELS_PER_OCTAVE ((float)(3.010299956639812 / PICTURE_STEP_DB))

static float greater(float a, float b)
{
    return a > b ? a : b;
}

VECTOR_CLONES
static float find_peak(const float *x, size_t n)
{
    float lane[VECTOR_LANES] = {0.0f}, most = 0.0f;
    size_t i = 0;

    for (; i + VECTOR_LANES <= n; i += VECTOR_LANES)
        for (size_t k = 0; k < VECTOR_LANES; k++) {
            float v = x[i + k] <= FLT_MAX ? x[i + k] : 0.0f;
            lane[k] = greater(v, lane[k]);
        }
    for (; i < n; i++)
        most = greater(x[i] <= FLT_MAX ? x[i] : 0.0f, most);
    for (size_t k = 0; k < VECTOR_LANES; k++)
        most = greater(lane[k], most);
    return most;
}

/* log2 of 1 <= 2^-e x < 2 by a polynomial that is exact at both ends and off by less than
 * 2e-4 between, so that the levels rise with the intensity. */
VECTOR_CLONES
static void quantize(const float *restrict x, size_t n, float scale,
                     uint8_t *restrict level)
{
    for (size_t i = 0; i < n; i++) {
        float v = x[i] * scale;
        uint32_t bits;
        memcpy(&bits, &v, sizeof bits);
        float octave = (float)((int32_t)(bits >> 23) - 127);
        uint32_t mantissa = (bits & 0x7fffffu) | 0x3f800000u;
        float m;
        memcpy(&m, &mantissa, sizeof m);
        float f = m - 1.0f;
        float log2 = octave + f +
                     f * (1.0f - f) * (0.43807325f - f * (0.23669342f - f * 0.0803073f));
        float at = 255.5f + LEVELS_PER_OCTAVE * log2;
        bool is_seen = v > 0.0f && v < 1.01f && at >= 1.0f; /* 1: up to rounding */
        level[i] = (uint8_t)(is_seen ? (int32_t)at : 0);
    }
}

VECTOR_CLONES
static void fold_row(const uint8_t *restrict row, size_t n, uint8_t *restrict out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = row[i] > out[i] ? row[i] : out[i];
}

VECTOR_CLONES
static uint8_t row_peak(const uint8_t *row, size_t n)
{
    uint8_t most = 0;

    for (size_t i = 0; i < n; i++)
        most = row[i] > most ? row[i] : most;
    return most;
}

static void project(struct picture *p)
{
    const size_t *n = p->grid.n;

    for (size_t z = 0; z < n[2]; z++) {
        for (size_t y = 0; y < n[1]; y++) {
            const uint8_t *row = p->level + (z * n[1] + y) * n[0];
            fold_row(row, n[0], p->projection[PICTURE_XY] + y * n[0]);
            fold_row(row, n[0], p->projection[PICTURE_XZ] + z * n[0]);
            p->projection[PICTURE_YZ][z * n[1] + y] = row_peak(row, n[0]);
        }
    }
}

size_t picture_side_size(const struct picture *p, enum picture_side side, size_t n[2])
{
    n[0] = p->grid.n[side == PICTURE_YZ ? 1 : 0];
    n[1] = p->grid.n[side == PICTURE_XY ? 1 : 2];
    return n[0] * n[1];
}

int picture_create(struct picture *out, const struct grid *grid, const float *intensity)
{
    size_t n = grid_size(grid), extents[2];
    bool there;

    memset(out, 0, sizeof *out);
    if (!n)
        return -EINVAL;
    out->grid = *grid;
    out->level = malloc(n);
    there = out->level;
    for (int i = 0; i < PICTURE_SIDES; i++) {
        out->projection[i] =
            calloc(picture_side_size(out, (enum picture_side)i, extents), 1);
        there = there && out->projection[i];
    }
    if (!there) {
        picture_clear(out);
        return -ENOMEM;
    }
    float peak = find_peak(intensity, n);
    double full = 0.0;
    /* Below that the quotient overflows: nothing there is an image. */
    if (peak >= FLT_MIN &&
        colour_full_scale(&full, &out->noise, intensity, n, (double)peak)) {
        picture_clear(out);
        return -ENOMEM;
    }
    out->peak = fmin(full, FLT_MAX);
    out->brightest = peak >= FLT_MIN ? (double)peak : 0.0;
    quantize(intensity, n, out->peak > 0.0 ? (float)(1.0 / out->peak) : 0.0f, out->level);
    project(out);
    return 0;
}

const uint8_t *picture_slice(const struct picture *p, size_t k)
{
    return p->level + k * p->grid.n[0] * p->grid.n[1];
}

void picture_clear(struct picture *p)
{
    free(p->level);
    for (int i = 0; i < PICTURE_SIDES; i++)
        free(p->projection[i]);
    memset(p, 0, sizeof *p);
}
