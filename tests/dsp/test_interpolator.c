/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <complex.h>
#include <errno.h>

#include "dsp/interpolator.h"
#include "tests/dsp/near.h"
#include "tests/worse.h"

/* What the weights make of exp(2 pi i frequency t) at t = fraction. */
static double complex apply(const float *w, double frequency)
{
    double complex sum = 0.0;

    for (int q = 0; q < INTERPOLATOR_TAPS; q++)
        sum += w[q] * cexp(2.0 * M_PI * I * frequency * (q - INTERPOLATOR_BEFORE));
    return sum;
}

/* Mean square over the band at the worst fraction. */
static double mean_square_error(const struct interpolator *ip, double occupancy,
                                size_t which)
{
    double worst = 0.0;

    for (int i = 0; i <= 37; i++) {
        float w[2 * INTERPOLATOR_TAPS];
        double fraction = i / 37.0, sum = 0.0;
        interpolator_weights(ip, fraction, w);
        for (int k = 0; k < 200; k++) {
            double f = occupancy * ((k + 0.5) / 200.0 - 0.5);
            double complex exact = cexp(2.0 * M_PI * I * f * fraction);
            if (which)
                exact *= 2.0 * M_PI * I * f;
            double e = cabs(apply(w + which * INTERPOLATOR_TAPS, f) - exact);
            sum += e * e / 200.0;
        }
        worst = worse(worst, sum);
    }
    return worst;
}

static void a_band_is_interpolated_to_what_the_header_says(void **state)
{
    static const struct {
        double occupancy, value_db, slope_db;
    } cases[] = {{0.5, -70.0, -58.0}, {0.55, -63.0, -51.0}, {0.3, -95.0, -80.0}};

    (void)state;
    for (size_t i = 0; i < 3; i++) {
        struct interpolator *ip;
        assert_int_equal(interpolator_create(&ip, cases[i].occupancy), 0);
        double value = 10.0 * log10(mean_square_error(ip, cases[i].occupancy, 0));
        double slope = 10.0 * log10(mean_square_error(ip, cases[i].occupancy, 1));
        assert_true(value < cases[i].value_db && slope < cases[i].slope_db);
        interpolator_destroy(ip);
    }
}

static void on_a_sample_the_sample_itself_is_taken(void **state)
{
    struct interpolator *ip;
    float w[2 * INTERPOLATOR_TAPS];

    (void)state;
    assert_int_equal(interpolator_create(&ip, 0.5), 0);
    for (int end = 0; end < 2; end++) {
        interpolator_weights(ip, end, w);
        for (int q = 0; q < INTERPOLATOR_TAPS; q++)
            assert_near(w[q], q == INTERPOLATOR_BEFORE + end, 1e-5);
    }
    interpolator_destroy(ip);
}

static void occupancies_without_sense_are_refused(void **state)
{
    static const double bad[] = {0.0, -0.5, 0.95, NAN};
    struct interpolator *ip = NULL;

    (void)state;
    for (size_t i = 0; i < 4; i++)
        assert_int_equal(interpolator_create(&ip, bad[i]), -EINVAL);
    assert_null(ip);
    interpolator_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_band_is_interpolated_to_what_the_header_says),
        cmocka_unit_test(on_a_sample_the_sample_itself_is_taken),
        cmocka_unit_test(occupancies_without_sense_are_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
