/* The sonar equation against closed forms, and against drawing echoes and noise. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hal/random.h"
#include "recon/detection_range.h"
#include "tests/dsp/near.h"

static const struct detection_range eight = {.n_pings = 8,
                                             .false_alarm_rate = 1e-4,
                                             .probability = 0.9,
                                             .scattering_m = 0.05,
                                             .stay = 8.0};

/* Of one ping both are exponential: snr = ln(rate) / ln(probability) - 1. */
static void one_ping_needs_what_the_closed_form_says(void **state)
{
    struct detection_range d = eight;

    (void)state;
    d.n_pings = 1;
    d.stay = 1.0;
    assert_near(detection_range_snr(&d), log(1e-4) / log(0.9) - 1.0, 1e-6);
    assert_near(detection_range_m(&d, 1e-6, 1e-10),
                pow(1e4 * 0.05 * 0.05 / (log(1e-4) / log(0.9) - 1.0), 0.25), 1e-9);
}

static double power_of_8(struct random *r)
{
    double sum = 0.0;

    for (int i = 0; i < 8; i++)
        sum -= log(1.0 - random_even(r));
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
    double snr = detection_range_snr(&eight), threshold = threshold_of_8(1e-4);
    struct random r;
    int passed = 0;

    (void)state;
    random_seed(&r, (uint64_t[]){4}, 1);
    for (int i = 0; i < 10000; i++)
        passed += (1.0 + snr) * power_of_8(&r) > threshold;
    assert_near(passed, 9000.0, 4.0 * 30.0); /* sqrt(10000 .9 .1) = 30 */
}

static void range_falls_with_the_fourth_root_of_noise(void **state)
{
    double before_m = INFINITY;

    (void)state;
    for (int db = 0; db <= 40; db++) {
        double m = detection_range_m(&eight, 1e-5, 1e-10 * pow(10.0, 0.1 * db));
        assert_true(m < before_m);
        if (db)
            assert_near(40.0 * log10(before_m / m), 1.0, 1e-9);
        before_m = m;
    }
    assert_true(detection_range_m(&eight, 0.0, 1e-10) == 0.0);
    assert_true(isinf(detection_range_m(&eight, 1e-5, 0.0)));
}

/* 1.2 m/s, 24 ms, voxels of 19 mm: 0.66 more pings than the one; who stands stays. */
static void who_walks_leaves_a_voxel(void **state)
{
    struct detection_range walks = eight;

    (void)state;
    walks.stay = detection_range_stay(1.2, 0.024, 0.019, 8);
    assert_near(walks.stay, 1.0 + 0.019 / 0.0288, 1e-9);
    assert_near(detection_range_stay(1e-9, 0.024, 0.019, 8), 8.0, 1e-9);
    assert_near(detection_range_snr(&walks) / detection_range_snr(&eight),
                8.0 / walks.stay, 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_ping_needs_what_the_closed_form_says),
        cmocka_unit_test(nine_of_ten_echoes_of_that_strength_pass_the_threshold),
        cmocka_unit_test(range_falls_with_the_fourth_root_of_noise),
        cmocka_unit_test(who_walks_leaves_a_voxel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
