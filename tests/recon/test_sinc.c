/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"
#include "tests/worse.h"

#include <complex.h>

#include "recon/coherent/sinc.h"

static const size_t taps[] = {2, 4, 6, 8, 12, 16};
static const double occupancies[] = {0.4, 0.5, 0.6, 0.8, 1.0};

static void weights_sum_to_one(void **state)
{
    (void)state;
    for (size_t n = 0; n < 6; n++) {
        for (size_t o = 0; o < 5; o++) {
            for (int f = 0; f <= 20; f++) {
                double w[16], sum = 0.0;
                sinc_weights(taps[n], occupancies[o], f / 20.0, w);
                for (size_t q = 0; q < taps[n]; q++)
                    sum += w[q];
                assert_near(sum, 1.0, 1e-12);
            }
        }
    }
}

static void on_a_sample_only_that_sample_counts(void **state)
{
    (void)state;
    for (size_t n = 0; n < 6; n++) {
        for (int end = 0; end <= 1; end++) {
            double w[16];
            sinc_weights(taps[n], 0.5, end, w);
            for (size_t q = 0; q < taps[n]; q++)
                assert_near(w[q], q == taps[n] / 2 - 1 + (size_t)end ? 1.0 : 0.0, 1e-12);
        }
    }
}

static void weights_are_the_same_from_both_sides(void **state)
{
    (void)state;
    for (size_t n = 0; n < 6; n++) {
        for (int f = 0; f <= 20; f++) {
            double w[16], mirrored[16];
            sinc_weights(taps[n], 0.6, f / 20.0, w);
            sinc_weights(taps[n], 0.6, 1.0 - f / 20.0, mirrored);
            for (size_t q = 0; q < taps[n]; q++)
                assert_near(w[q], mirrored[taps[n] - 1 - q], 1e-12);
        }
    }
}

static double worst_error(size_t n_taps, double occupancy)
{
    double worst = 0.0;
    for (int f = 0; f <= 16; f++) {
        double w[16];
        sinc_weights(n_taps, occupancy, f / 16.0, w);
        for (int b = -16; b <= 16; b++) {
            double turn = 2.0 * M_PI * 0.5 * occupancy * b / 16.0;
            double at = (double)n_taps / 2.0 - 1.0 + f / 16.0;
            double complex sum = 0.0;
            for (size_t q = 0; q < n_taps; q++)
                sum += w[q] * cexp(I * turn * (double)q);
            worst = worse(worst, cabs(sum - cexp(I * turn * at)));
        }
    }
    return worst;
}

/* The design formula is for one image of the spectrum; at worst six of those that matter
 * add up, which is 15.6 dB. */
static void a_band_limited_signal_is_interpolated_as_well_as_promised(void **state)
{
    (void)state;
    for (size_t n = 1; n < 6; n++) {
        for (size_t o = 0; o < 4; o++) {
            double promised_db = 8.0 + 2.285 * (double)taps[n] * 2.0 * M_PI *
                                           (1.0 - occupancies[o]);
            double db = 20.0 * log10(worst_error(taps[n], occupancies[o]));
            assert_below(db, -promised_db + 15.6);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_sum_to_one),
        cmocka_unit_test(on_a_sample_only_that_sample_counts),
        cmocka_unit_test(weights_are_the_same_from_both_sides),
        cmocka_unit_test(a_band_limited_signal_is_interpolated_as_well_as_promised),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
