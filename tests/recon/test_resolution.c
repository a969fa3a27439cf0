/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/planning/resolution.h"
#include "tests/recon/turntable.h"

/* Lindell 2019, Fig. 4: a confocal pair, a scatterer 0.5 m aside: gamma c r / (2 * 0.5),
 * the same for 9.5 kHz of sound as for 60 ps of light. */
static void a_confocal_pair_has_the_figure_s_resolution(void **state)
{
    (void)state;
    static const double pair[3] = {0.0, 0.0, 0.0}, at[3] = {0.5, 0.0, 3.0};
    const double band_hz[2] = {5000.0, 14500.0};
    double gamma_s = resolution_gamma_s(band_hz), r = hypot(0.5, 3.0);
    assert_near(gamma_s, 1.0 / 19000.0, 1e-12);
    double sound = resolution_pair_m(gamma_s, 343.0, pair, pair, at, 0);
    assert_near(sound, 343.0 / 19000.0 * r / (2.0 * 0.5), 1e-12);
    double light = resolution_pair_m(60e-12, RESOLUTION_LIGHT_M_S, pair, pair, at, 0);
    assert_near(light, 60e-12 * 299792458.0 * r, 1e-12);
    assert_near(light / sound, 1.0, 0.01);
}

/* By differences of the path: a step of dx changes it by gamma c. */
static void a_step_of_the_resolution_is_one_gamma_of_time(void **state)
{
    (void)state;
    static const double s[3] = {0.1, -0.3, 0.0}, m[3] = {-0.7, 0.2, 0.1},
                        at[3] = {0.4, 0.1, 2.3};
    double gamma_s = 1e-7, c = 343.0; /* small: the path is straight over the step */
    for (int axis = 0; axis < 3; axis++) {
        double there[3] = {at[0], at[1], at[2]};
        double step_m = resolution_pair_m(gamma_s, c, s, m, at, axis);
        there[axis] += step_m;
        double change_m = reference_distance(s, there) + reference_distance(m, there) -
                          reference_distance(s, at) - reference_distance(m, at);
        assert_near(fabs(change_m) / c, gamma_s, 2e-3 * gamma_s);
    }
}

static void straight_before_a_pair_there_is_no_lateral_resolution(void **state)
{
    (void)state;
    static const double pair[3] = {0.2, 0.0, 0.0}, at[3] = {0.2, 0.0, 1.0};
    assert_true(isinf(resolution_pair_m(1e-4, 343.0, pair, pair, at, 0)));
    assert_near(resolution_pair_m(1e-4, 343.0, pair, pair, at, 2), 1e-4 * 343.0 / 2.0,
                1e-12);
    assert_true(isinf(resolution_pair_m(1e-4, 343.0, pair, pair, pair, 2)));
}

static void the_finest_pair_counts(void **state)
{
    (void)state;
    struct turntable t;
    const double at[3] = {0.05, 0.02, 0.0};
    double finest[3], expected = INFINITY;
    turntable_default(&t);
    resolution_finest_m(&t.geometry, 1e-5, at, finest);
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        expected = fmin(expected, resolution_pair_m(1e-5, 343.0, t.pings_m[k][0],
                                                    t.pings_m[k][1], at, 1));
    assert_near(finest[1], expected, 1e-12);
    assert_near(finest[0], 1e-5 * 343.0 / 2.0, 0.05 * 1e-5 * 343.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_confocal_pair_has_the_figure_s_resolution),
        cmocka_unit_test(a_step_of_the_resolution_is_one_gamma_of_time),
        cmocka_unit_test(straight_before_a_pair_there_is_no_lateral_resolution),
        cmocka_unit_test(the_finest_pair_counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
