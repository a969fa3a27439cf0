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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_axis_that_is_not_resolved_is_stepped_along_too),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
