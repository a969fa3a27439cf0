/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/imaging/fold.h"
#include "tests/recon/rig.h"

/* 4 x 4 elements on 16 stage positions of 2 cm, midpoints 0.3 x 0.27 m: what the fast way
 * of a scan takes. */
static void scan_default(struct rig *r)
{
    rig_default(r);
    for (size_t k = 0; k < 16; k++)
        r->positions_m[k] = 0.02 * ((double)k - 7.5);
    r->geometry.n_positions = 16;
    rig_look_at(r, 0.0, 0.0, 1.1, 17, 0.01);
}

/* -- the image in double precision ------------------------------------------------------
 */

/* The echo's power, filtered: -G'' of 8 mm of path, by an integral. */
static double filtered_power(const struct rig *r, double late_s)
{
    double c = r->geometry.sound_speed_m_s, sigma_s = 0.008 / c, step_s = sigma_s / 40.0;
    double sum = 0.0;
    for (int q = -240; q <= 240; q++) {
        double u = (double)q / 40.0;
        double p = reference_pulse(r->band_hz, late_s - (double)q * step_s);
        sum += (1.0 - u * u) * exp(-0.5 * u * u) * p * p * step_s;
    }
    return sum / sigma_s;
}

/* Sum over all pairs, each midpoint once, of an echo of one point at a voxel. */
static double reference_voxel(const struct rig *r, const uint32_t *cell, size_t n_cells,
                              const struct scatterer *p, const double voxel[3])
{
    const struct geometry *g = &r->geometry;
    size_t pairs = g->n_speakers * g->n_microphones, n = pairs * g->n_positions;
    double c = g->sound_speed_m_s, sum = 0.0;
    for (size_t t = 0; t < n; t++) {
        double s[3], m[3], fold = 0.0;
        geometry_speaker(g, t / pairs, t % pairs / g->n_microphones, s);
        geometry_microphone(g, t / pairs, 0, t % pairs % g->n_microphones, m);
        for (size_t q = 0; q < n; q++)
            fold += cell[q] == cell[t];
        double rs = reference_distance(s, p->at_m), rm = reference_distance(m, p->at_m);
        double at = reference_distance(s, voxel) + reference_distance(m, voxel);
        double gain = p->gain / (rs * rm) * 0.5 * (rs + rm);
        sum += gain * gain * filtered_power(r, (at - rs - rm) / c) / fold;
    }
    return sum / (double)n_cells;
}

static void expect_reference(const struct rig *r, double tolerance)
{
    const struct scatterer point = {{0.013, -0.022, 1.104}, 1.0};
    size_t n = r->geometry.n_positions * r->geometry.n_speakers *
               r->geometry.n_microphones;
    uint32_t *cell = malloc(n * sizeof *cell);
    size_t n_cells, n_side = r->grid.n[0] * r->grid.n[1], bright = 0;
    assert_non_null(cell);
    assert_int_equal(fold_number(&r->geometry, cell, &n_cells), 0);
    float *image = rig_image(r, "incoherent", &point, 1, 2);
    double peak = reference_voxel(r, cell, n_cells, &point, point.at_m);
    for (size_t v = 5; v < grid_size(&r->grid); v += 47) {
        double at[3] = {
            r->grid.origin_m[0] + r->grid.step_m[0] * (double)(v % r->grid.n[0]),
            r->grid.origin_m[1] + r->grid.step_m[1] * (double)(v % n_side / r->grid.n[0]),
            r->grid.origin_m[2] + r->grid.step_m[2] * (double)(v / n_side)};
        double expected = fmax(reference_voxel(r, cell, n_cells, &point, at), 0.0);
        assert_near(image[v] / peak, expected / peak, tolerance);
        bright += expected > 0.2 * peak;
    }
    assert_true(bright >= 5); /* of a hundred: most of the image is dark */
    free(image);
    free(cell);
}

static void a_scan_s_image_is_that_of_double_precision(void **state)
{
    (void)state;
    struct rig r;
    scan_default(&r);
    expect_reference(&r, 0.03);
}

static void any_geometry_s_image_is_that_of_double_precision(void **state)
{
    (void)state;
    struct rig r;
    scan_default(&r);
    r.positions_m[3] += 0.004;
    r.positions_m[11] -= 0.007;
    r.speakers_m[2][2] = 0.05;
    r.microphones_m[1][0] = -0.03;
    expect_reference(&r, 0.03);
}

static void few_voxels_and_interpolation_make_the_same_image(void **state)
{
    (void)state;
    const struct scatterer point = {{0.013, -0.022, 1.104}, 1.0};
    struct rig r;
    scan_default(&r);
    float *whole = rig_image(&r, "incoherent", &point, 1, 1);
    struct rig fine;
    scan_default(&fine);
    rig_look_at(&fine, 0.0, 0.0, 1.1, 33, 0.005); /* worth coarsening: 9.4 mm there */
    fine.grid.step_m[2] = 0.01;
    fine.grid.n[2] = 17;
    float *image = rig_image(&fine, "incoherent", &point, 1, 1);
    float peak = 0.0f;
    for (size_t v = 0; v < grid_size(&r.grid); v++)
        peak = whole[v] > peak ? whole[v] : peak;
    for (size_t v = 0; v < grid_size(&r.grid); v++) {
        size_t x = v % 17, y = v / 17 % 17, z = v / (17 * 17);
        assert_near(image[(z * 33 + 2 * y) * 33 + 2 * x] / peak, whole[v] / peak, 0.02);
    }
    free(whole);
    free(image);
}

/* -- what it is for ---------------------------------------------------------------------
 */

static void a_point_is_where_it_is(void **state)
{
    (void)state;
    static const double places[3][3] = {
        {0.0, 0.0, 1.1}, {0.041, -0.033, 1.0531}, {-0.05, 0.03, 1.2017}};
    for (int q = 0; q < 3; q++) {
        struct rig r;
        scan_default(&r);
        rig_look_at(&r, places[q][0] + 0.004, places[q][1] - 0.003, places[q][2] + 0.0017,
                    21, 0.01);
        /* a twentieth of its width, which 0.3 m of aperture makes 0.2 m */
        rig_expect_point(&r, "incoherent", places[q], 1e-2, 2e-3);
    }
}

/* Elements 10 mm off their places, each on its own: coherent sums lose the point, powers
 * keep it. */
static void elements_out_of_place_do_not_lose_the_point(void **state)
{
    (void)state;
    const struct scatterer point = {{0.02, 0.01, 1.1}, 1.0};
    unsigned long long seed = 11;
    struct rig wrong, right;
    scan_default(&wrong);
    scan_default(&right);
    for (size_t e = 0; e < 4; e++) {
        for (int a = 0; a < 3; a++) {
            wrong.speakers_m[e][a] += 0.035 * (reference_random(&seed) - 0.5);
            wrong.microphones_m[e][a] += 0.035 * (reference_random(&seed) - 0.5);
        }
    }
    struct pool *pool;
    struct peak_fit fit;
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager *im = rig_imager(&right, "incoherent", pool);
    rig_add(&wrong, im, &point, 1);
    float *image = malloc(grid_size(&right.grid) * sizeof *image);
    assert_non_null(image);
    imager_image(im, image);
    rig_peak(&right, image, &fit);
    for (int a = 0; a < 2; a++)
        assert_near(fit.position_m[a], point.at_m[a], 0.05);
    assert_near(fit.position_m[2], point.at_m[2], 0.02);
    free(image);
    imager_destroy(im);
    pool_destroy(pool);
}

/* -- bad input, repeated use ------------------------------------------------------------
 */

static void what_is_no_number_or_too_loud_is_silence(void **state)
{
    (void)state;
    static const float bad[4] = {NAN, INFINITY, -INFINITY, 1e30f};
    for (int way = 0; way < 2; way++) {
        struct rig r;
        struct pool *pool;
        scan_default(&r);
        r.positions_m[3] += 0.004 * way;
        assert_int_equal(pool_create(&pool, 2), 0);
        struct imager *im = rig_imager(&r, "incoherent", pool);
        size_t n = 4 * r.format.n_samples;
        float complex *traces = malloc(n * sizeof *traces);
        float *image = malloc(grid_size(&r.grid) * sizeof *image);
        assert_true(traces && image);
        for (size_t q = 0; q < n; q++)
            traces[q] = bad[q % 4];
        for (size_t p = 0; p < 64; p++)
            imager_add(im, p / 4, p % 4, traces, NULL);
        imager_image(im, image);
        for (size_t v = 0; v < grid_size(&r.grid); v++)
            assert_near(image[v], 0.0, 0.0);
        free(traces);
        free(image);
        imager_destroy(im);
        pool_destroy(pool);
    }
}

static void images_on_the_way_do_not_change_the_last(void **state)
{
    (void)state;
    const struct scatterer point = {{0.02, 0.01, 1.1}, 1.0};
    struct rig r;
    struct pool *pool;
    scan_default(&r);
    float *expected = rig_image(&r, "incoherent", &point, 1, 1);
    float *image = malloc(grid_size(&r.grid) * sizeof *image);
    assert_non_null(image);
    assert_int_equal(pool_create(&pool, 2), 0);
    struct imager *im = rig_imager(&r, "incoherent", pool);
    for (int scan = 0; scan < 2; scan++) {
        imager_reset(im);
        rig_add_some(&r, im, &point, 1, 0, 30);
        imager_image(im, image);
        rig_add_some(&r, im, &point, 1, 30, 64);
        imager_image(im, image);
        assert_below(rig_difference(&r, expected, image), 1e-5);
    }
    free(expected);
    free(image);
    imager_destroy(im);
    pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_s_image_is_that_of_double_precision),
        cmocka_unit_test(any_geometry_s_image_is_that_of_double_precision),
        cmocka_unit_test(few_voxels_and_interpolation_make_the_same_image),
        cmocka_unit_test(a_point_is_where_it_is),
        cmocka_unit_test(elements_out_of_place_do_not_lose_the_point),
        cmocka_unit_test(what_is_no_number_or_too_loud_is_silence),
        cmocka_unit_test(images_on_the_way_do_not_change_the_last),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
