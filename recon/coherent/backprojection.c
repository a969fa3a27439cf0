/* SPDX-License-Identifier: MIT */
/* recon/coherent/backprojection.c -- stores the traces and weighs them; see
 * backprojection.h. */
#include "recon/coherent/backprojection.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/fold.h"
#include "recon/imaging/method.h"

#define LANE_BLOCK 16 /* lanes of a group are padded to a multiple of this */

static size_t n_traces(const struct backprojection *b)
{
    return backprojection_pairs(b) * b->geometry.n_positions;
}

/* -- create -----------------------------------------------------------------------------
 */

static void backprojection_destroy(void *state)
{
    struct backprojection *b = state;
    if (!b)
        return;
    if (b->scan)
        backproject_scan_destroy(b);
    else
        backproject_any_destroy(b);
    backproject_store_destroy(b);
    free(b->cell);
    free(b->live);
    free(b->fold);
    geometry_clear(&b->geometry);
    free(b);
}

static int allocate(struct backprojection *b, const struct imager_config *cfg)
{
    size_t n = n_traces(b);
    b->cell = malloc(n * sizeof *b->cell);
    b->live = calloc(n, sizeof *b->live);
    if (!b->cell || !b->live)
        return -ENOMEM;
    int err = fold_number(&b->geometry, b->cell, &b->n_cells);
    if (err)
        return err;
    b->fold = malloc(b->n_cells * sizeof *b->fold);
    if (!b->fold)
        return -ENOMEM;
    double gate_s = 2.0 * cfg->gate_m[0] / cfg->geometry->sound_speed_m_s;
    err = backproject_store_create(b, &cfg->format, cfg->band_hz[1] - cfg->band_hz[0],
                                   gate_s);
    if (err)
        return err;
    return b->scan ? backproject_scan_create(b) : backproject_any_create(b);
}

static double middle(const struct backprojection *b, size_t t, int axis)
{
    const struct geometry *g = &b->geometry;
    size_t k = t / backprojection_pairs(b), pair = t % backprojection_pairs(b);
    double s[3], m[3];
    geometry_speaker(g, k, pair / g->n_microphones, s);
    geometry_microphone(g, k, pair / g->n_microphones, pair % g->n_microphones, m);
    return 0.5 * (s[axis] + m[axis]);
}

/* Mean and rms distance from it of the pairs' midpoints. */
static void find_centre(struct backprojection *b)
{
    size_t n = n_traces(b);
    double sum2 = 0.0;
    for (int a = 0; a < 3; a++) {
        double sum = 0.0;
        for (size_t t = 0; t < n; t++)
            sum += middle(b, t, a);
        b->centre_m[a] = sum / (double)n;
        for (size_t t = 0; t < n; t++)
            sum2 += pow(middle(b, t, a) - b->centre_m[a], 2.0);
    }
    b->spread_m = sqrt(sum2 / (double)n);
}

static int backprojection_create(void **state, const struct imager_config *cfg,
                                 const char **why)
{
    (void)why;
    struct backprojection *b = calloc(1, sizeof *b);
    if (!b)
        return -ENOMEM;
    b->grid = cfg->grid;
    b->pool = cfg->pool;
    b->coherence = cfg->options ? (float)cfg->options->coherence : 0.0f;
    double low[3], high[3];
    geometry_aperture(cfg->geometry, low, high);
    b->plane_z_m = 0.5 * (low[2] + high[2]);
    int err = geometry_copy(&b->geometry, cfg->geometry);
    if (!err) {
        if (b->geometry.pings_m)
            find_centre(b);
        b->scan = backproject_scan_fits(b);
        b->lanes = b->scan ? (b->geometry.n_positions + LANE_BLOCK - 1) / LANE_BLOCK *
                                 LANE_BLOCK
                           : 1;
        err = allocate(b, cfg);
    }
    if (err) {
        backprojection_destroy(b);
        return err;
    }
    *state = b;
    return 0;
}

/* -- add, image -------------------------------------------------------------------------
 */

static void backprojection_add(void *state, size_t position, size_t speaker,
                               const float complex *traces, const bool *masked)
{
    struct backprojection *b = state;
    size_t n = b->geometry.n_microphones, length = b->fine.in.n_samples;
    for (size_t i = 0; i < n; i++) {
        size_t t = position * backprojection_pairs(b) + speaker * n + i;
        if (masked && masked[i])
            continue;
        memcpy(b->added + t * length, traces + i * length, length * sizeof *traces);
        b->live[t] = true;
        b->stored_fold[t] = STORE_STALE;
    }
}

static void backprojection_reset(void *state)
{
    struct backprojection *b = state;
    memset(b->live, 0, n_traces(b) * sizeof *b->live);
}

float backprojection_depth_m(const struct backprojection *b, float x_m, float y_m,
                             float z_m)
{
    if (!b->geometry.pings_m)
        return z_m - (float)b->plane_z_m;
    float dx = x_m - (float)b->centre_m[0], dy = y_m - (float)b->centre_m[1];
    float dz = z_m - (float)b->centre_m[2], spread = (float)b->spread_m;
    return sqrtf(dx * dx + dy * dy + dz * dz + spread * spread);
}

float backprojection_intensity(const struct backprojection *b, float depth_m, float re,
                               float im, float power)
{
    float sum2 = re * re + im * im, scale = depth_m / (float)b->n_cells;
    float out = scale * scale * sum2;
    if (b->coherence == 0.0f || out == 0.0f)
        return out;
    float factor = sum2 / ((float)b->n_live_cells * power);
    return out * powf(fminf(factor, 1.0f), b->coherence);
}

static void backprojection_image(void *state, float *intensity)
{
    struct backprojection *b = state;
    backproject_store(b);
    b->image = intensity;
    if (b->scan)
        backproject_scan(b);
    else
        backproject_any(b);
}

const struct imager_method method_backprojection = {
    .name = "backprojection",
    .any_geometry = true,
    .continuous = true,
    .adds = true,
    .create = backprojection_create,
    .add = backprojection_add,
    .image = backprojection_image,
    .reset = backprojection_reset,
    .destroy = backprojection_destroy,
};
