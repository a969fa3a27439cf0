/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>

#include "recon/grid.h"
#include "tests/recon/rig.h"

static void limits_include_both_ends(void **state)
{
    (void)state;
    const double limits[3][3] = {{-0.5, 0.5, 0.1}, {0.0, 1.0, 0.3}, {2.0, 2.0, 0.01}};
    struct grid g;
    assert_int_equal(grid_from_limits(&g, limits), 0);
    assert_int_equal(g.n[0], 11);
    assert_int_equal(g.n[1], 4); /* 0, 0.3, 0.6, 0.9 */
    assert_int_equal(g.n[2], 1);
    assert_int_equal(grid_size(&g), 44);
    for (int a = 0; a < 3; a++) {
        assert_near(g.origin_m[a], limits[a][0], 0.0);
        assert_near(g.step_m[a], limits[a][2], 0.0);
    }
}

static void steps_that_binary_cannot_hold_lose_no_voxel(void **state)
{
    (void)state;
    for (int n = 1; n < 300; n++) {
        const double limits[3][3] = {
            {-0.35, -0.35 + n * 0.007, 0.007}, {0.0, n * 0.1, 0.1}, {1.0, 1.0, 1.0}};
        struct grid g;
        assert_int_equal(grid_from_limits(&g, limits), 0);
        assert_int_equal(g.n[0], n + 1);
        assert_int_equal(g.n[1], n + 1);
    }
}

static void expect_limits(double min, double max, double step, int expected)
{
    for (int a = 0; a < 3; a++) {
        double limits[3][3] = {{0.0, 1.0, 0.1}, {0.0, 1.0, 0.1}, {0.0, 1.0, 0.1}};
        struct grid g;
        limits[a][0] = min;
        limits[a][1] = max;
        limits[a][2] = step;
        assert_int_equal(grid_from_limits(&g, (const double(*)[3])limits), expected);
    }
}

static void limits_that_make_no_sense_are_refused_on_every_axis(void **state)
{
    (void)state;
    expect_limits(0.0, 1.0, 0.0, -EINVAL);
    expect_limits(0.0, 1.0, -0.1, -EINVAL);
    expect_limits(0.0, 1.0, NAN, -EINVAL);
    expect_limits(1.0, 0.999, 0.1, -EINVAL);
    expect_limits(NAN, 1.0, 0.1, -EINVAL);
    expect_limits(0.0, NAN, 0.1, -EINVAL);
    expect_limits(0.0, INFINITY, 0.1, -EINVAL);
    expect_limits(-INFINITY, 0.0, 0.1, -EINVAL);
}

/* Its voxels would stand at 0 times infinity. */
static void an_infinite_step_is_refused(void **state)
{
    (void)state;
    expect_limits(0.0, 1.0, INFINITY, -EINVAL);
}

static void too_many_voxels_are_refused(void **state)
{
    (void)state;
    struct grid g;
    const double most[3][3] = {{0.0, 1023.0, 1.0}, {0.0, 1023.0, 1.0}, {0.0, 255.0, 1.0}};
    const double more[3][3] = {{0.0, 1023.0, 1.0}, {0.0, 1023.0, 1.0}, {0.0, 256.0, 1.0}};
    assert_int_equal(grid_from_limits(&g, most), 0);
    assert_int_equal(grid_size(&g), (size_t)1 << 28);
    assert_int_equal(grid_from_limits(&g, more), -EFBIG);
    expect_limits(0.0, 1e6, 1e-300, -EFBIG);
}

static double end(const struct grid *g, int axis)
{
    return g->origin_m[axis] + (double)(g->n[axis] - 1) * g->step_m[axis];
}

static void the_default_holds_aperture_and_gate(void **state)
{
    (void)state;
    struct rig r;
    struct grid g;
    const double gate_m[2] = {0.8, 2.0}, up[3] = {0.31, -1.7, 0.25};
    double min[3], max[3];
    rig_default(&r);
    rig_move(&r, up);
    geometry_aperture(&r.geometry, min, max);
    grid_default(&g, &r.geometry, gate_m, r.band_hz);
    for (int a = 0; a < 2; a++) {
        assert_true(g.origin_m[a] < min[a] && end(&g, a) > max[a]);
        assert_true(g.origin_m[a] > min[a] - 0.2 && end(&g, a) < max[a] + 0.2);
    }
    assert_near(g.origin_m[2], 0.25 + 0.8, 1e-12);
    assert_true(end(&g, 2) <= 0.25 + 2.0 + 1e-9);
    assert_true(end(&g, 2) > 0.25 + 2.0 - g.step_m[2]);
}

/* c / 2B in depth, half a mean wavelength times range over aperture across. */
static void the_default_steps_resolve_a_point(void **state)
{
    (void)state;
    struct rig r;
    struct grid g;
    const double gate_m[2] = {0.8, 2.0};
    rig_default(&r);
    grid_default(&g, &r.geometry, gate_m, r.band_hz);
    double across_m = 0.5 * 343.0 / 11000.0 * 0.8 / 0.28;
    for (int a = 0; a < 2; a++)
        assert_true(g.step_m[a] > 0.0 && g.step_m[a] < across_m);
    assert_true(g.step_m[2] > 0.0 && g.step_m[2] < 343.0 / (2.0 * 18000.0));
}

static void the_default_of_one_pair_is_a_grid_too(void **state)
{
    (void)state;
    struct rig r;
    struct grid g;
    const double gates_m[2][2] = {{0.0, 1.0}, {5.0, 5.0}};
    rig_default(&r);
    r.geometry.n_speakers = r.geometry.n_microphones = r.geometry.n_positions = 1;
    for (int q = 0; q < 2; q++) {
        grid_default(&g, &r.geometry, gates_m[q], r.band_hz);
        for (int a = 0; a < 3; a++)
            assert_true(g.step_m[a] > 0.0 && isfinite(g.origin_m[a]) && g.n[a] >= 1);
        assert_true(grid_size(&g) < 1000000);
    }
}

static void brute_delays(const struct rig *r, double out[2])
{
    const struct geometry *g = &r->geometry;
    out[0] = INFINITY;
    out[1] = 0.0;
    for (size_t v = 0; v < grid_size(&r->grid); v++) {
        const size_t at[3] = {v % r->grid.n[0], v / r->grid.n[0] % r->grid.n[1],
                              v / (r->grid.n[0] * r->grid.n[1])};
        double p[3], s[3], m[3];
        for (int a = 0; a < 3; a++)
            p[a] = r->grid.origin_m[a] + r->grid.step_m[a] * (double)at[a];
        for (size_t q = 0; q < g->n_positions * g->n_speakers * g->n_microphones; q++) {
            size_t k = q / (g->n_speakers * g->n_microphones);
            geometry_speaker(g, k, q / g->n_microphones % g->n_speakers, s);
            geometry_microphone(g, k, 0, q % g->n_microphones, m);
            double t = (reference_distance(s, p) + reference_distance(m, p)) /
                       g->sound_speed_m_s;
            out[0] = fmin(out[0], t);
            out[1] = fmax(out[1], t);
        }
    }
}

/* Looser than the truth by no more than the sound needs across the array. */
static void delays_hold_every_path_and_little_more(void **state)
{
    (void)state;
    static const double places[4][3] = {
        {0.0, 0.0, 1.1}, {0.7, -0.4, 0.8}, {-1.5, 0.0, 0.3}, {0.0, 2.0, 2.0}};
    struct rig r;
    rig_default(&r);
    double array_s = hypot(0.28, 0.36) / 343.0;
    for (int q = 0; q < 4; q++) {
        double found[2], exact[2];
        rig_look_at(&r, places[q][0], places[q][1], places[q][2], 7, 0.03);
        grid_delays(&r.grid, &r.geometry, found);
        brute_delays(&r, exact);
        assert_true(found[0] <= exact[0] + 1e-12 && found[1] >= exact[1] - 1e-12);
        assert_true(found[0] > exact[0] - array_s && found[1] < exact[1] + array_s);
    }
}

static void the_delays_of_one_place_to_one_voxel_are_exact(void **state)
{
    (void)state;
    struct rig r;
    double found[2], exact[2];
    rig_default(&r);
    r.geometry.n_speakers = r.geometry.n_microphones = r.geometry.n_positions = 1;
    r.geometry.sound_speed_m_s = 300.0;
    rig_look_at(&r, 0.3, -0.2, 1.3, 1, 0.01);
    grid_delays(&r.grid, &r.geometry, found);
    brute_delays(&r, exact);
    assert_near(found[0], exact[0], 1e-12);
    assert_near(found[1], exact[1], 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(limits_include_both_ends),
        cmocka_unit_test(steps_that_binary_cannot_hold_lose_no_voxel),
        cmocka_unit_test(limits_that_make_no_sense_are_refused_on_every_axis),
        cmocka_unit_test(an_infinite_step_is_refused),
        cmocka_unit_test(too_many_voxels_are_refused),
        cmocka_unit_test(the_default_holds_aperture_and_gate),
        cmocka_unit_test(the_default_steps_resolve_a_point),
        cmocka_unit_test(the_default_of_one_pair_is_a_grid_too),
        cmocka_unit_test(delays_hold_every_path_and_little_more),
        cmocka_unit_test(the_delays_of_one_place_to_one_voxel_are_exact),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
