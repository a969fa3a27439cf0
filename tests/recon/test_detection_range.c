/* SPDX-License-Identifier: MIT */
/* The sonar equation against closed forms, and against drawing echoes and noise. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "hal/random.h"
#include "recon/frontend/range_monitor.h"
#include "tests/dsp/near.h"

static const struct detection_range eight = {
    .n_pings = 8, .false_alarm_rate = 1e-4, .probability = 0.9, .stay = 8.0};

/* Of one ping both are exponential: snr = ln(rate) / ln(probability) - 1. */
static void one_ping_needs_what_the_closed_form_says(void **state)
{
    struct detection_range d = eight;

    (void)state;
    d.n_pings = 1;
    d.stay = 1.0;
    assert_near(detection_range_snr(&d), log(1e-4) / log(0.9) - 1.0, 1e-6);
    assert_near(detection_range_m(0.05, detection_range_snr(&d), 1e-6, 1e-10),
                pow(1e4 * 0.05 * 0.05 / (log(1e-4) / log(0.9) - 1.0), 0.25), 1e-9);
}

/* Of n pings with noise of power 1, of which the first have an echo too. */
static double power_of(struct random *r, size_t n, size_t n_loud, double snr)
{
    double sum = 0.0;

    for (size_t i = 0; i < n; i++)
        sum -= (i < n_loud ? 1.0 + snr : 1.0) * log(1.0 - random_even(r));
    return sum;
}

/* Q(8, x) = e^-x (1 + x + ... + x^7 / 7!): found by bisection. */
static double threshold_of_8(double rate)
{
    double low = 0.0, high = 100.0;

    for (int i = 0; i < 100; i++) {
        double x = 0.5 * (low + high), term = 1.0, sum = 1.0;
        for (int k = 1; k < 8; k++)
            sum += term *= x / k;
        if (sum * exp(-x) > rate)
            low = x;
        else
            high = x;
    }
    return low;
}

static void nine_of_ten_echoes_of_that_strength_pass_the_threshold(void **state)
{
    static const size_t n_loud[] = {1, 2, 3, 5, 7, 8};
    double threshold = threshold_of_8(1e-4);
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){4}, 1);
    for (size_t k = 0; k < sizeof n_loud / sizeof *n_loud; k++) {
        struct detection_range d = eight;
        int passed = 0;
        d.stay = (double)n_loud[k];
        double snr = detection_range_snr(&d);
        for (int i = 0; i < 10000; i++)
            passed += power_of(&r, 8, n_loud[k], snr) > threshold;
        if (abs(passed - 9000) > 120) /* 4 sqrt(10000 .9 .1) */
            fail_msg("%zu of 8 pings: %d of 10000", n_loud[k], passed);
    }
}

static void range_falls_with_the_fourth_root_of_noise(void **state)
{
    double before_m = INFINITY, snr = detection_range_snr(&eight);

    (void)state;
    for (int db = 0; db <= 40; db++) {
        double m = detection_range_m(0.05, snr, 1e-5, 1e-10 * pow(10.0, 0.1 * db));
        assert_true(m < before_m);
        if (db)
            assert_near(40.0 * log10(before_m / m), 1.0, 1e-9);
        before_m = m;
    }
    assert_true(detection_range_m(0.05, snr, 0.0, 1e-10) == 0.0);
    assert_true(isinf(detection_range_m(0.05, snr, 1e-5, 0.0)));
}

/* 1.2 m/s, 24 ms, voxels of 19 mm: 0.66 more pings than the one; who stands stays. */
static void who_walks_leaves_a_voxel(void **state)
{
    (void)state;
    assert_near(detection_range_stay(1.2, 0.024, 0.019, 8), 1.0 + 0.019 / 0.0288, 1e-9);
    assert_near(detection_range_stay(1e-9, 0.024, 0.019, 8), 8.0, 1e-9);
}

/* The more fleeting, the louder: by more than what his share of the pings is less, since
 * fewer of them have the chance to be loud. */
static void who_stays_for_less_has_to_be_louder(void **state)
{
    double before = INFINITY, before_stay = 1.0;

    (void)state;
    for (double stay = 1.0; stay <= 8.0; stay += 0.25) {
        struct detection_range d = eight;
        d.stay = stay;
        double snr = detection_range_snr(&d);
        assert_true(snr * stay < before * before_stay);
        before = snr;
        before_stay = stay;
    }
}

/* Where no bisection finds anything. */
static void values_that_make_no_sense_have_no_answer(void **state)
{
    static const struct detection_range bad[] = {
        {0, 1e-4, 0.9, 1.0},  {8, 0.0, 0.9, 8.0},  {8, NAN, 0.9, 8.0},
        {8, 1e-4, 1.0, 8.0},  {8, 1e-4, NAN, 8.0}, {8, 1e-4, 0.9, 0.5},
        {8, 1e-4, 0.9, 8.01}, {8, 1e-4, 0.9, NAN},
    };
    static const double rates[] = {1e-12, 1e-6, 0.5}, chances[] = {0.5, 0.9, 0.999};

    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_true(isnan(detection_range_snr(&bad[i])));
    for (size_t n = 1; n <= 4096; n *= 8)
        for (int k = 0; k < 3; k++)
            for (int i = 0; i < 3; i++)
                for (int all = 0; all < 2; all++) {
                    struct detection_range d = {n, rates[k], chances[i],
                                                all ? (double)n : 1.0};
                    assert_true(isfinite(detection_range_snr(&d)));
                }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_ping_needs_what_the_closed_form_says),
        cmocka_unit_test(nine_of_ten_echoes_of_that_strength_pass_the_threshold),
        cmocka_unit_test(range_falls_with_the_fourth_root_of_noise),
        cmocka_unit_test(who_walks_leaves_a_voxel),
        cmocka_unit_test(who_stays_for_less_has_to_be_louder),
        cmocka_unit_test(values_that_make_no_sense_have_no_answer),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
