/* SPDX-License-Identifier: MIT */
#include "tests/recon/rig.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/recon/near.h"
#include "tests/worse.h"

void rig_default(struct rig *r)
{
    memset(r, 0, sizeof *r);
    for (size_t e = 0; e < 4; e++) {
        r->speakers_m[e][1] = 0.12 * ((double)e - 1.5);
        r->microphones_m[e][1] = 0.06 * ((double)e - 1.5);
    }
    for (size_t k = 0; k < 8; k++)
        r->positions_m[k] = 0.04 * ((double)k - 3.5);
    r->geometry = (struct geometry){
        .sound_speed_m_s = 343.0,
        .n_speakers = 4,
        .n_microphones = 4,
        .n_positions = 8,
        .speakers_m = (const double(*)[3])r->speakers_m,
        .microphones_m = (const double(*)[3])r->microphones_m,
        .stage_axis = {1.0, 0.0, 0.0},
        .stage_positions_m = r->positions_m,
    };
    r->band_hz[0] = 2000.0;
    r->band_hz[1] = 20000.0;
    r->format.rate_hz = 36000.0;
    r->format.carrier_hz = 11000.0;
    r->gate_m[0] = 0.3;
    r->gate_m[1] = 1.8;
    rig_listen(r, 0.7, 1.75);
    rig_look_at(r, 0.0, 0.0, 1.1, 21, 0.012);
    r->grid.n[2] = 25;
    r->grid.step_m[2] = 0.005;
    r->grid.origin_m[2] = 1.1 - 12 * 0.005;
}

void rig_pairs(struct rig *r)
{
    rig_default(r);
    r->geometry.n_speakers = r->geometry.n_microphones = 8;
    for (size_t e = 0; e < 8; e++) {
        r->speakers_m[e][0] = -0.015;
        r->microphones_m[e][0] = 0.015;
        r->speakers_m[e][1] = r->microphones_m[e][1] = 0.05 * ((double)e - 3.5);
    }
}

void rig_look_at(struct rig *r, double x_m, double y_m, double z_m, size_t n,
                 double step_m)
{
    const double at[3] = {x_m, y_m, z_m};
    for (int a = 0; a < 3; a++) {
        r->grid.n[a] = n;
        r->grid.step_m[a] = step_m;
        r->grid.origin_m[a] = at[a] - 0.5 * step_m * (double)(n - 1);
    }
}

void rig_listen(struct rig *r, double near_m, double far_m)
{
    double c = r->geometry.sound_speed_m_s;
    r->format.t0_s = 2.0 * near_m / c;
    r->format.n_samples = (size_t)(2.0 * (far_m - near_m) / c * r->format.rate_hz);
}

void rig_move(struct rig *r, const double by_m[3])
{
    for (int a = 0; a < 3; a++) {
        for (size_t e = 0; e < RIG_MAX; e++) {
            r->speakers_m[e][a] += by_m[a];
            r->microphones_m[e][a] += by_m[a];
        }
        r->grid.origin_m[a] += by_m[a];
    }
}

void rig_ping(const struct rig *r, size_t position, size_t speaker,
              const struct scatterer *points, size_t n_points, float complex *traces)
{
    for (size_t i = 0; i < r->geometry.n_microphones; i++) {
        double s[3], m[3];
        for (int a = 0; a < 3; a++) {
            double moved = r->geometry.stage_axis[a] * r->positions_m[position];
            s[a] = r->speakers_m[speaker][a] + moved;
            m[a] = r->microphones_m[i][a] + moved;
        }
        reference_trace(&r->format, r->band_hz, r->geometry.sound_speed_m_s, s, m, points,
                        n_points, traces + i * r->format.n_samples);
    }
}

struct trace_set rig_traces(const struct rig *r, const struct scatterer *points,
                            size_t n_points)
{
    const struct geometry *g = &r->geometry;
    struct trace_set set = {.geometry = g,
                            .format = r->format,
                            .band_hz = {r->band_hz[0], r->band_hz[1]},
                            .gate_m = {r->gate_m[0], r->gate_m[1]}};
    size_t pairs = trace_set_pairs(&set), n = g->n_positions * pairs;
    float complex *traces = malloc(n * r->format.n_samples * sizeof *traces);
    bool *heard = malloc(n * sizeof *heard);
    assert_true(traces && heard);
    for (size_t q = 0; q < n; q++)
        heard[q] = true;
    for (size_t p = 0; p < g->n_positions * g->n_speakers; p++)
        rig_ping(r, p / g->n_speakers, p % g->n_speakers, points, n_points,
                 traces + p * g->n_microphones * r->format.n_samples);
    set.traces = traces;
    set.heard = heard;
    return set;
}

void rig_free_traces(struct trace_set *set)
{
    free((void *)set->traces);
    free((void *)set->heard);
}

struct imager_config rig_config(const struct rig *r, const char *method,
                                struct pool *pool)
{
    return (struct imager_config){
        .method = method,
        .geometry = &r->geometry,
        .format = r->format,
        .band_hz = {r->band_hz[0], r->band_hz[1]},
        .gate_m = {r->gate_m[0], r->gate_m[1]},
        .grid = r->grid,
        .pool = pool,
    };
}

int rig_try(const struct rig *r, const char *method, struct pool *pool,
            struct imager **out, const char **why)
{
    const struct imager_config cfg = rig_config(r, method, pool);
    return imager_create(out, &cfg, why);
}

struct imager *rig_imager(const struct rig *r, const char *method, struct pool *pool)
{
    struct imager *im = NULL;
    const char *why = "";
    int err = rig_try(r, method, pool, &im, &why);
    if (err)
        fail_msg("imager_create(%s): %s (%s)", method, strerror(-err), why);
    return im;
}

void rig_add_some(const struct rig *r, struct imager *im, const struct scatterer *points,
                  size_t n_points, size_t first, size_t end)
{
    size_t n_s = r->geometry.n_speakers;
    float complex *traces =
        malloc(r->geometry.n_microphones * r->format.n_samples * sizeof *traces);
    assert_non_null(traces);
    for (size_t p = first; p < end; p++) {
        rig_ping(r, p / n_s, p % n_s, points, n_points, traces);
        assert_true(imager_add(im, p / n_s, p % n_s, traces, NULL));
    }
    free(traces);
}

void rig_add(const struct rig *r, struct imager *im, const struct scatterer *points,
             size_t n_points)
{
    rig_add_some(r, im, points, n_points, 0,
                 r->geometry.n_positions * r->geometry.n_speakers);
}

float *rig_image(const struct rig *r, const char *method, const struct scatterer *points,
                 size_t n_points, size_t n_threads)
{
    struct pool *pool;
    assert_int_equal(pool_create(&pool, n_threads), 0);
    struct imager *im = rig_imager(r, method, pool);
    rig_add(r, im, points, n_points);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    assert_non_null(image);
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    return image;
}

float rig_peak(const struct rig *r, const float *image, struct peak_fit *out)
{
    size_t best = 0;
    for (size_t v = 0; v < grid_size(&r->grid); v++) {
        assert_true(isfinite(image[v]) && image[v] >= 0.0f);
        best = image[v] > image[best] ? v : best;
    }
    peak_fit(&r->grid, image, best, 1000.0, PEAK_ZERO_EMPTY, NULL, out);
    return image[best];
}

double rig_difference(const struct rig *r, const float *a, const float *b)
{
    double worst = 0.0, largest = 0.0;
    for (size_t v = 0; v < grid_size(&r->grid); v++) {
        worst = worse(worst, fabs((double)a[v] - (double)b[v]));
        largest = fmax(largest, fmax(a[v], b[v]));
    }
    return worst / largest;
}

void rig_expect_point(const struct rig *r, const char *method, const double at_m[3],
                      double lateral_m, double depth_m)
{
    const struct scatterer point = {{at_m[0], at_m[1], at_m[2]}, 1.0};
    float *image = rig_image(r, method, &point, 1, 1);
    struct peak_fit fit;
    rig_peak(r, image, &fit);
    free(image);
    assert_near(fit.position_m[0], at_m[0], lateral_m);
    assert_near(fit.position_m[1], at_m[1], lateral_m);
    assert_near(fit.position_m[2], at_m[2], depth_m);
}
