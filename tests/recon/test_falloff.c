/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>

#include "recon/planning/falloff.h"
#include "tests/recon/reference.h"

static void a_power_law_is_found_exactly(void **state)
{
    (void)state;
    static const double slopes[4] = {-2.0, -4.0, 0.0, -1.89};
    double d[7], p[7];
    for (int q = 0; q < 4; q++) {
        struct falloff_fit fit;
        for (int i = 0; i < 7; i++) {
            d[i] = 0.3 + 0.7 * i;
            p[i] = 3e-5 * pow(d[i], slopes[q]);
        }
        assert_int_equal(falloff_fit(&fit, d, p, 7), 0);
        assert_near(fit.slope, slopes[q], 1e-12);
        assert_near(fit.power_at_1, 3e-5, 1e-16);
        assert_near(fit.sigma, 0.0, 1e-12);
        assert_int_equal(fit.n, 7);
    }
}

/* The slope does not depend on the gain, nor on the unit of distance. */
static void units_do_not_matter(void **state)
{
    (void)state;
    static const double d[4] = {1.0, 1.5, 2.5, 4.0}, p[4] = {1.0, 0.5, 0.13, 0.07};
    static const double gains[3] = {1e-12, 1e12, 0.3};
    struct falloff_fit fit, other;
    assert_int_equal(falloff_fit(&fit, d, p, 4), 0);
    for (int q = 0; q < 3; q++) {
        double feet[4], loud[4];
        for (int i = 0; i < 4; i++) {
            feet[i] = d[i] / 0.3048;
            loud[i] = p[i] * gains[q];
        }
        assert_int_equal(falloff_fit(&other, feet, loud, 4), 0);
        assert_near(other.slope, fit.slope, 1e-9);
        assert_near(other.sigma, fit.sigma, 1e-9);
    }
}

/* Residuals of one sign and the other: sigma is what the textbook says. */
static void sigma_is_that_of_the_residuals(void **state)
{
    (void)state;
    const double e = 0.1, d[4] = {1.0, M_E, exp(2.0), exp(3.0)};
    /* log power = -2 x + e (1, -1, -1, 1): orthogonal to 1 and to x. */
    const double p[4] = {exp(e), exp(-2.0 - e), exp(-4.0 - e), exp(-6.0 + e)};
    struct falloff_fit fit;
    assert_int_equal(falloff_fit(&fit, d, p, 4), 0);
    assert_near(fit.slope, -2.0, 1e-12);
    assert_near(fit.sigma, sqrt(4.0 * e * e / 2.0 / 5.0), 1e-12);
}

static void what_has_no_logarithm_does_not_count(void **state)
{
    (void)state;
    static const double d[6] = {1.0, 2.0, 4.0, 0.0, NAN, 3.0},
                        p[6] = {1.0, 0.25, 0.0625, 1.0, 1.0, 0.0};
    struct falloff_fit fit;
    assert_int_equal(falloff_fit(&fit, d, p, 6), 0);
    assert_int_equal(fit.n, 3);
    assert_near(fit.slope, -2.0, 1e-12);
}

static void one_distance_has_no_slope(void **state)
{
    (void)state;
    static const double same[3] = {2.0, 2.0, 2.0}, p[3] = {1.0, 2.0, 3.0};
    struct falloff_fit fit;
    assert_int_equal(falloff_fit(&fit, same, p, 3), -EINVAL);
    assert_int_equal(falloff_fit(&fit, same, p, 1), -EINVAL);
    assert_int_equal(falloff_fit(&fit, same, p, 0), -EINVAL);
    const double two[2] = {1.0, 2.0};
    assert_int_equal(falloff_fit(&fit, two, p, 2), 0);
    assert_true(isnan(fit.sigma));
}

static void a_peak_is_read_between_samples(void **state)
{
    (void)state;
    const struct trace_format f = {0.004, 36000.0, 11000.0, 200};
    const double band_hz[2] = {2000.0, 20000.0};
    for (int q = 0; q < 10; q++) {
        float complex trace[200];
        double delay_s = 0.0061 + 0.1 * q / 36000.0, at_s, power;
        for (int n = 0; n < 200; n++)
            trace[n] = (float complex)(
                0.02 * reference_echo(band_hz, 11000.0, delay_s, 0.004 + n / 36000.0));
        assert_int_equal(falloff_peak(&f, trace, &at_s, &power), 0);
        assert_near(at_s, delay_s, 0.02 / 36000.0);
        assert_near(10.0 * log10(power), 20.0 * log10(0.02), 0.05);
    }
}

static void silence_and_nan_have_no_peak(void **state)
{
    (void)state;
    const struct trace_format f = {0.0, 1000.0, 0.0, 3};
    float complex trace[3] = {0.0f};
    double at_s, power;
    assert_int_equal(falloff_peak(&f, trace, &at_s, &power), -ENODATA);
    trace[0] = 1.0f;
    assert_int_equal(falloff_peak(&f, trace, &at_s, &power), 0);
    assert_near(at_s, 0.0, 0.0); /* at the rim: no parabola */
    trace[1] = NAN;
    assert_int_equal(falloff_peak(&f, trace, &at_s, &power), -ENODATA);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_power_law_is_found_exactly),
        cmocka_unit_test(units_do_not_matter),
        cmocka_unit_test(sigma_is_that_of_the_residuals),
        cmocka_unit_test(what_has_no_logarithm_does_not_count),
        cmocka_unit_test(one_distance_has_no_slope),
        cmocka_unit_test(a_peak_is_read_between_samples),
        cmocka_unit_test(silence_and_nan_have_no_peak),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
