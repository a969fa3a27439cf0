/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/imaging/coarse.h"
#include "tests/recon/array_traces.h"

static double far_m(const struct grid *g, int axis)
{
    return g->origin_m[axis] + g->step_m[axis] * (double)(g->n[axis] - 1);
}

/* Of a width that is not known no steps can be made: what is seen there would be seen at
 * the volume's ends alone, where its depth is another. */
static void an_axis_that_is_not_resolved_is_stepped_along_too(void **state)
{
    (void)state;
    static const double volume_m[3][3] = {
        {0.0, 1.0, 0.02}, {0.0, 1.0, 0.02}, {1.1, 2.95, 0.01}};
    struct array_traces a;
    struct imager_config look;
    struct grid grid;
    array_traces_create(&a, 1);
    assert_int_equal(grid_from_limits(&grid, volume_m), 0);
    const struct imager_config wanted = trace_set_imager(&a.set, &grid, NULL);
    coarse_view(&wanted, &look);
    assert_true(look.grid.step_m[1] <= 4.0 * grid.step_m[1]);
    for (int i = 0; i < 3; i++) {
        assert_near(far_m(&look.grid, i), far_m(&grid, i), 1e-9);
        assert_near(look.grid.origin_m[i], grid.origin_m[i], 0.0);
    }
    array_traces_clear(&a);
}

static void it_is_by_the_lower_half_of_the_band_or_by_an_octave(void **state)
{
    static const double bands_hz[3][3] = {
        {5000.0, 50000.0, 22500.0}, {12000.0, 50000.0, 24000.0}, {30e3, 50e3, 50e3}};
    struct rig r;

    (void)state;
    rig_pairs(&r);
    for (int q = 0; q < 3; q++) {
        struct imager_config wanted = rig_config(&r, "backprojection", NULL), look;
        wanted.band_hz[0] = bands_hz[q][0];
        wanted.band_hz[1] = bands_hz[q][1];
        coarse_view(&wanted, &look);
        assert_near(look.band_hz[0], bands_hz[q][0], 0.0);
        assert_near(look.band_hz[1], bands_hz[q][2], 1e-6);
        assert_string_equal(look.method, "fast");
    }
}

/* Of steps of which the fourth place is not quite 3 of them away, too; and a plane. */
static void a_grid_that_is_coarse_stays_as_it_is(void **state)
{
    struct rig r;

    (void)state;
    rig_pairs(&r);
    rig_look_at(&r, 0.0, 0.0, 3.0, 4, 0.4);
    r.grid.n[1] = 1;
    r.grid.n[2] = 3;
    const struct imager_config wanted = rig_config(&r, "fast", NULL);
    struct imager_config look;
    coarse_view(&wanted, &look);
    for (int a = 0; a < 3; a++) {
        assert_int_equal(look.grid.n[a], r.grid.n[a]);
        assert_near(look.grid.step_m[a], 0.4, 1e-12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_by_the_lower_half_of_the_band_or_by_an_octave),
        cmocka_unit_test(a_grid_that_is_coarse_stays_as_it_is),
        cmocka_unit_test(an_axis_that_is_not_resolved_is_stepped_along_too),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
