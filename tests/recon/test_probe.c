/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/planning/probe.h"
#include "tests/recon/array_traces.h"

static const double volume_m[3][3] = {
    {0.0, 1.0, 0.02}, {0.0, 1.0, 0.02}, {1.1, 2.95, 0.01}};

static struct probe look(const struct array_traces *a, size_t threads)
{
    struct probe p;
    struct grid grid;
    struct pool *pool;
    assert_int_equal(grid_from_limits(&grid, volume_m), 0);
    assert_int_equal(pool_create(&pool, threads), 0);
    assert_int_equal(probe_run(&p, &a->set, &grid, NULL, pool), 0);
    pool_destroy(pool);
    return p;
}

static void objects_and_the_depth_they_need_are_found(void **state)
{
    (void)state;
    struct array_traces a;
    const struct scatterer points[] = {{{0.3, 0.62, 1.8}, 1.0}, {{0.71, 0.4, 2.2}, 1.3}};
    array_traces_create(&a, 8);
    array_traces_fill(&a, points, 2, 0.0);
    struct probe p = look(&a, 2);
    assert_true(p.imaged);
    assert_true(p.n_objects >= 2);
    for (int i = 0; i < 2; i++) {
        double nearest_m = INFINITY;
        for (int q = 0; q < 2; q++)
            nearest_m = fmin(nearest_m,
                             reference_distance(p.objects[i].position_m, points[q].at_m));
        assert_below(nearest_m, 0.015);
    }
    assert_true(p.depth_m[0] < 1.75 && p.depth_m[0] > 1.3);
    assert_true(p.depth_m[1] > 2.25 && p.depth_m[1] < 2.7);
    assert_false(p.specular);
    array_traces_clear(&a);
}

/* The image of a mirror is that of each element's mirror image: all pairs hear one echo
 * of the path 2 sqrt(z^2 + h^2), whatever the midpoint. */
static void fill_mirror(struct array_traces *a, double z_m)
{
    const struct geometry *g = a->set.geometry;
    size_t n = a->set.format.n_samples, pairs = trace_set_pairs(&a->set);
    for (size_t q = 0; q < g->n_positions * pairs; q++) {
        double h = 0.5 * (g->speakers_m[q % pairs / g->n_microphones][1] -
                          g->microphones_m[q % g->n_microphones][1]);
        double path = 2.0 * hypot(z_m, h);
        for (size_t s = 0; s < n; s++)
            a->traces[q * n + s] = (float complex)(
                reference_echo(a->set.band_hz, a->set.format.carrier_hz,
                               path / g->sound_speed_m_s,
                               a->set.format.t0_s + (double)s / a->set.format.rate_hz) /
                path);
    }
}

static void a_mirror_is_told_from_a_point(void **state)
{
    (void)state;
    struct array_traces a;
    array_traces_create(&a, 8);
    fill_mirror(&a, 2.0);
    struct probe p = look(&a, 1);
    assert_true(p.specular);
    assert_near(p.scattering.bend, 0.0, 0.05);
    array_traces_clear(&a);
}

/* Where the image of every n-th speaker's pairs, without dip moveout, has its peak:
 * y, of a point at this place. */
static double peak_of_fewer_m(struct array_traces *a, size_t stride, const double at_m[3])
{
    const struct geometry *g = a->set.geometry;
    size_t n = g->n_positions * trace_set_pairs(&a->set), per = g->n_microphones;
    struct imager_options plain;
    struct peak_fit fit;
    const char *why;
    struct imager *im;
    rig_look_at(&a->rig, at_m[0], at_m[1], at_m[2], 25, 0.004);
    for (size_t q = 0; q < n; q++)
        a->heard[q] = q / per % g->n_speakers % stride == 0;
    imager_options_default(&plain);
    plain.dmo = 0;
    struct imager_config cfg = {.method = "fast",
                                .geometry = g,
                                .format = a->set.format,
                                .band_hz = {a->set.band_hz[0], a->set.band_hz[1]},
                                .gate_m = {a->set.gate_m[0], a->set.gate_m[1]},
                                .grid = a->rig.grid,
                                .options = &plain};
    assert_int_equal(pool_create(&cfg.pool, 1), 0);
    assert_int_equal(imager_create(&im, &cfg, &why), 0);
    float *image = malloc(grid_size(&cfg.grid) * sizeof *image);
    assert_non_null(image);
    assert_int_equal(trace_set_feed(&a->set, im, cfg.pool), 0);
    imager_image(im, image);
    rig_peak(&a->rig, image, &fit);
    free(image);
    imager_destroy(im);
    pool_destroy(cfg.pool);
    return fit.position_m[1];
}

static void what_fewer_speakers_add_is_what_the_image_shows(void **state)
{
    (void)state;
    static const struct scatterer point = {{0.5, 0.5, 1.4}, 1.0};
    static const double around[3][3] = {
        {0.4, 0.6, 0.02}, {0.4, 0.6, 0.02}, {1.35, 1.45, 0.01}};
    struct array_traces a;
    struct probe p;
    struct grid grid;
    array_traces_create(&a, 16);
    array_traces_fill(&a, &point, 1, 0.0);
    assert_int_equal(grid_from_limits(&grid, around), 0);
    struct pool *pool;
    assert_int_equal(pool_create(&pool, 1), 0);
    assert_int_equal(probe_run(&p, &a.set, &grid, NULL, pool), 0);
    pool_destroy(pool);
    assert_true(p.n_objects > 0);
    double all_m = peak_of_fewer_m(&a, 1, point.at_m);
    for (int i = 0; i < 2; i++) {
        double shift_m = peak_of_fewer_m(&a, (size_t)2 << i, point.at_m) - all_m;
        assert_near(p.objects[0].fewer_m[i][1] / shift_m, 1.0, 0.3);
    }
    array_traces_clear(&a);
}

/* The pairs of a position stand up to 3 cm apart along the stage, and hear a point aside
 * so much earlier or later; elements that are off by 6 mm show all the same. */
static void a_stage_that_goes_on_is_not_taken_for_elements_that_are_off(void **state)
{
    (void)state;
    const struct scatterer point = {{0.2, 0.45, 2.0}, 1.0};
    for (int off = 0; off < 2; off++) {
        struct array_traces a;
        array_traces_create(&a, 12);
        array_traces_displace(&a, 0.006 * off);
        a.rig.geometry.slot_m = 0.0025;
        a.rig.geometry.together = 1;
        array_traces_fill(&a, &point, 1, 0.0);
        struct probe p = look(&a, 2);
        if (off)
            assert_near(p.coherence.element_m, 0.006, 0.0012);
        else
            assert_below(p.coherence.element_m, 0.001);
        array_traces_clear(&a);
    }
}

static void silence_keeps_all_depths(void **state)
{
    (void)state;
    struct array_traces a;
    array_traces_create(&a, 4);
    array_traces_fill(&a, NULL, 0, 0.0);
    struct probe p = look(&a, 1);
    assert_int_equal(p.n_objects, 0);
    assert_near(p.depth_m[0], 1.1, 1e-9);
    assert_near(p.depth_m[1], 2.95, 0.011);
    assert_true(isnan(p.coherence.element_m));
    array_traces_clear(&a);
}

static void a_single_pair_in_motion_is_looked_at_too(void **state)
{
    (void)state;
    struct array_traces a;
    const struct scatterer point = {{0.5, 0.5, 2.0}, 1.0};
    array_traces_create(&a, 1);
    array_traces_fill(&a, &point, 1, 0.0);
    struct probe p = look(&a, 1);
    assert_true(p.imaged);
    assert_true(isnan(p.coherence.element_m));
    array_traces_clear(&a);
}

static void threads_do_not_change_what_is_seen(void **state)
{
    (void)state;
    struct array_traces a;
    const struct scatterer point = {{0.4, 0.6, 2.1}, 1.0};
    array_traces_create(&a, 6);
    array_traces_fill(&a, &point, 1, 0.01);
    struct probe one = look(&a, 1), two = look(&a, 2);
    assert_int_equal(one.n_objects, two.n_objects);
    assert_near(one.snr_db, two.snr_db, 0.01);
    assert_near(one.depth_m[1], two.depth_m[1], 1e-9);
    array_traces_clear(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(objects_and_the_depth_they_need_are_found),
        cmocka_unit_test(a_mirror_is_told_from_a_point),
        cmocka_unit_test(what_fewer_speakers_add_is_what_the_image_shows),
        cmocka_unit_test(a_stage_that_goes_on_is_not_taken_for_elements_that_are_off),
        cmocka_unit_test(silence_keeps_all_depths),
        cmocka_unit_test(a_single_pair_in_motion_is_looked_at_too),
        cmocka_unit_test(threads_do_not_change_what_is_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
