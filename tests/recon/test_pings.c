/* SPDX-License-Identifier: MIT */
/* Pings with places of their own: any array, any motion. */
#include "tests/recon/near.h"

#include <errno.h>
#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "recon/detection/peak.h"
#include "recon/imaging/imager.h"
#include "tests/recon/rig.h"
#include "tests/recon/turntable.h"
#include "tests/worse.h"

static const struct trace_format sampled = {0.0038, 44000.0, 20300.0, 140};

static struct grid around(double x, double y, double z, size_t n, double step)
{
    struct grid g = {.n = {n, n, n}, .step_m = {step, step, step}};
    const double middle[3] = {x, y, z};
    for (int a = 0; a < 3; a++)
        g.origin_m[a] = middle[a] - step * (double)(n / 2);
    return g;
}

/* The intensity on the heap. */
static float *image(const struct turntable *t, const struct grid *grid,
                    const struct scatterer *points, size_t n_points)
{
    struct pool *pool;
    struct imager *im;
    float complex *traces = malloc(TURNTABLE_PINGS * sampled.n_samples * sizeof *traces);
    float *out = calloc(grid_size(grid), sizeof *out);
    assert_int_equal(pool_create(&pool, 2), 0);
    struct imager_config cfg = {.method = "backprojection",
                                .geometry = &t->geometry,
                                .format = sampled,
                                .band_hz = {t->band_hz[0], t->band_hz[1]},
                                .gate_m = {0.2, 2.0},
                                .grid = *grid,
                                .pool = pool};
    assert_int_equal(imager_create(&im, &cfg, NULL), 0);
    turntable_traces(t, &sampled, points, n_points, traces);
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        assert_true(imager_add(im, k, 0, traces + k * sampled.n_samples, NULL));
    imager_image(im, out);
    imager_destroy(im);
    pool_destroy(pool);
    free(traces);
    return out;
}

static void a_point_amid_the_circle_is_within_a_millimetre(void **state)
{
    (void)state;
    static const struct scatterer points[3] = {{{0.0, 0.0, 0.0}, 1.0},
                                               {{0.0513, -0.0322, 0.0171}, 1.0},
                                               {{0.2, 0.1, -0.1}, 1.0}};
    struct turntable t;
    turntable_default(&t);
    for (int p = 0; p < 3; p++) {
        const double *at = points[p].at_m;
        struct grid g = around(at[0] + 0.0007, at[1] - 0.0004, at[2] + 0.001, 15, 0.002);
        float *intensity = image(&t, &g, &points[p], 1);
        size_t best = 0;
        for (size_t v = 0; v < grid_size(&g); v++) {
            assert_true(isfinite(intensity[v]));
            best = intensity[v] > intensity[best] ? v : best;
        }
        assert_true(intensity[best] > 0.0f);
        struct peak_fit fit;
        peak_fit(&g, intensity, best, 100.0, PEAK_ZERO_EMPTY, NULL, &fit);
        for (int a = 0; a < 3; a++)
            assert_near(fit.position_m[a], at[a], 1e-3);
        free(intensity);
    }
}

static void the_image_is_that_of_double_precision_to_40_db(void **state)
{
    (void)state;
    static const struct scatterer points[3] = {{{0.01, 0.02, 0.0}, 1.0},
                                               {{-0.031, 0.012, 0.02}, -0.7},
                                               {{0.02, -0.04, -0.03}, 0.5}};
    struct turntable t;
    turntable_default(&t);
    struct grid g = around(0.0, 0.0, 0.0, 15, 0.0067);
    float *intensity = image(&t, &g, points, 3);
    double largest = 0.0, worst = 0.0;
    for (size_t v = 0; v < grid_size(&g); v++) {
        const double at[3] = {g.origin_m[0] + g.step_m[0] * (double)(v % 15),
                              g.origin_m[1] + g.step_m[1] * (double)(v / 15 % 15),
                              g.origin_m[2] + g.step_m[2] * (double)(v / 225)};
        double expected = turntable_amplitude(&t, points, 3, at);
        largest = fmax(largest, expected);
        worst = worse(worst, fabs(sqrt((double)intensity[v]) - expected));
    }
    assert_true(largest > 0.5);
    assert_below(20.0 * log10(worst / largest), -40.0);
    free(intensity);
}

/* A scan, told ping by ping, is the same image but for the weight with depth. */
static void a_scan_told_ping_by_ping_is_the_same_image(void **state)
{
    (void)state;
    static const struct scatterer point = {{0.03, -0.04, 1.1}, 1.0};
    struct rig r;
    rig_default(&r);
    rig_look_at(&r, 0.03, -0.04, 1.1, 11, 0.01);
    float *scan = rig_image(&r, "backprojection", &point, 1, 2);

    size_t n_s = r.geometry.n_speakers, n_m = r.geometry.n_microphones;
    size_t n = n_s * n_m * r.geometry.n_positions;
    double(*pings)[2][3] = calloc(n, sizeof *pings);
    double *zeros = calloc(n, sizeof *zeros);
    float complex *traces = calloc(n_m * r.format.n_samples, sizeof *traces);
    float *own = calloc(grid_size(&r.grid), sizeof *own);
    for (size_t t = 0; t < n; t++) {
        geometry_speaker(&r.geometry, t / (n_s * n_m), t / n_m % n_s, pings[t][0]);
        geometry_microphone(&r.geometry, t / (n_s * n_m), 0, t % n_m, pings[t][1]);
    }
    struct geometry g = r.geometry;
    g.n_speakers = g.n_microphones = 1;
    g.n_positions = n;
    g.stage_positions_m = zeros;
    g.pings_m = (const double(*)[2][3])pings;
    struct pool *pool;
    struct imager *im;
    assert_int_equal(pool_create(&pool, 2), 0);
    struct imager_config cfg = {.method = "backprojection",
                                .geometry = &g,
                                .format = r.format,
                                .band_hz = {r.band_hz[0], r.band_hz[1]},
                                .gate_m = {r.gate_m[0], r.gate_m[1]},
                                .grid = r.grid,
                                .pool = pool};
    assert_int_equal(imager_create(&im, &cfg, NULL), 0);
    for (size_t k = 0; k < r.geometry.n_positions; k++)
        for (size_t j = 0; j < n_s; j++) {
            rig_ping(&r, k, j, &point, 1, traces);
            for (size_t i = 0; i < n_m; i++)
                imager_add(im, (k * n_s + j) * n_m + i, 0,
                           traces + i * r.format.n_samples, NULL);
        }
    imager_image(im, own);

    double low[3], high[3], spread2 = 0.0;
    geometry_aperture(&g, low, high);
    for (size_t t = 0; t < n; t++)
        for (int a = 0; a < 2; a++)
            spread2 +=
                pow(0.5 * (pings[t][0][a] + pings[t][1][a] - low[a] - high[a]), 2.0);
    spread2 /= (double)n;
    for (size_t v = 0; v < grid_size(&r.grid); v++) {
        double x = r.grid.origin_m[0] + r.grid.step_m[0] * (double)(v % 11);
        double y = r.grid.origin_m[1] + r.grid.step_m[1] * (double)(v / 11 % 11);
        double z = r.grid.origin_m[2] + r.grid.step_m[2] * (double)(v / 121) - low[2];
        double dx = x - 0.5 * (low[0] + high[0]), dy = y - 0.5 * (low[1] + high[1]);
        own[v] *= (float)(z * z / (z * z + dx * dx + dy * dy + spread2));
    }
    assert_below(rig_difference(&r, scan, own), 0.02);
    imager_destroy(im);
    pool_destroy(pool);
    free(scan);
    free(own);
    free(traces);
    free(pings);
    free(zeros);
}

static void methods_for_arrays_on_a_stage_say_so(void **state)
{
    (void)state;
    struct turntable t;
    struct pool *pool;
    struct imager *im;
    const char *why = "";
    turntable_default(&t);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager_config cfg = {.method = "fast",
                                .geometry = &t.geometry,
                                .format = sampled,
                                .band_hz = {t.band_hz[0], t.band_hz[1]},
                                .gate_m = {0.2, 2.0},
                                .grid = around(0.0, 0.0, 0.0, 5, 0.01),
                                .pool = pool};
    assert_int_equal(imager_create(&im, &cfg, &why), -ENOTSUP);
    assert_non_null(strstr(why, "backprojection"));
    pool_destroy(pool);
}

static void elements_are_where_their_ping_says(void **state)
{
    (void)state;
    struct turntable t;
    struct geometry copy;
    double at[3], low[3], high[3];
    turntable_default(&t);
    assert_int_equal(geometry_copy(&copy, &t.geometry), 0);
    geometry_speaker(&copy, 45, 0, at);
    assert_memory_equal(at, t.pings_m[45][0], sizeof at);
    geometry_microphone(&copy, 46, 0, 0, at);
    assert_memory_equal(at, t.pings_m[46][1], sizeof at);
    geometry_aperture(&copy, low, high);
    /* Midpoints go around on a circle of hypot(0.85, 0.035). */
    assert_near(high[0], hypot(0.85, 0.035), 1e-3);
    assert_near(low[1], -hypot(0.85, 0.035), 1e-3);
    assert_near(low[2], -0.145, 1e-12);
    assert_near(high[2], 0.155, 1e-12);
    geometry_clear(&copy);
}

static void delays_are_bounded_ping_by_ping(void **state)
{
    (void)state;
    struct turntable t;
    turntable_default(&t);
    struct grid g = around(0.1, -0.05, 0.02, 9, 0.02);
    double bounds[2], low = INFINITY, high = 0.0;
    grid_delays(&g, &t.geometry, bounds);
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        for (size_t v = 0; v < grid_size(&g); v++) {
            const double at[3] = {g.origin_m[0] + 0.02 * (double)(v % 9),
                                  g.origin_m[1] + 0.02 * (double)(v / 9 % 9),
                                  g.origin_m[2] + 0.02 * (double)(v / 81)};
            double d = (reference_distance(at, t.pings_m[k][0]) +
                        reference_distance(at, t.pings_m[k][1])) /
                       343.0;
            low = fmin(low, d);
            high = fmax(high, d);
        }
    /* Where a corner of the grid is the nearest or farthest, both sides are the same
     * number but for the rounding of some ten operations each. */
    assert_true(bounds[0] <= low * (1.0 + 20.0 * DBL_EPSILON) &&
                bounds[1] >= high * (1.0 - 20.0 * DBL_EPSILON));
    assert_near(bounds[0], low, 0.02 / 343.0);
    assert_near(bounds[1], high, 0.02 / 343.0);
}

/* Before the middle of a plane array: 1.207 lambda R / 2 D, and c / B in depth. */
static void resolution_of_pings_before_a_plane_is_the_array_s(void **state)
{
    (void)state;
    struct turntable t;
    double far[3], all_round[3], expected = 1.207 * (343.0 / 20000.0);
    turntable_default(&t);
    t.band_hz[0] = 19900.0; /* narrow: depth counts for nothing */
    t.band_hz[1] = 20100.0;
    const double before[3] = {0.0, 0.0, 40.0}, amid[3] = {0.0, 0.0, 0.0};
    geometry_resolution_at(&t.geometry, t.band_hz, before, far);
    assert_near(far[0], expected * 40.0 / (2.0 * 2.0 * 0.8507), 2e-3);
    assert_near(far[2], 343.0 / 200.0, 1e-2);
    /* Amid it the wave vectors fill a circle of 2 x 2 x 2 pi / lambda across. */
    geometry_resolution_at(&t.geometry, t.band_hz, amid, all_round);
    assert_near(all_round[0], expected / 4.0, 1e-4);
    assert_near(all_round[1], expected / 4.0, 1e-4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_amid_the_circle_is_within_a_millimetre),
        cmocka_unit_test(the_image_is_that_of_double_precision_to_40_db),
        cmocka_unit_test(a_scan_told_ping_by_ping_is_the_same_image),
        cmocka_unit_test(methods_for_arrays_on_a_stage_say_so),
        cmocka_unit_test(elements_are_where_their_ping_says),
        cmocka_unit_test(delays_are_bounded_ping_by_ping),
        cmocka_unit_test(resolution_of_pings_before_a_plane_is_the_array_s),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
