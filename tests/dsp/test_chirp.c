/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "dsp/chirp.h"
#include "tests/dsp/near.h"

#define RATE_HZ 48000.0
#define N       3000

static const struct chirp up = {2000.0, 20000.0, 0.0625, false};

static void the_length_is_duration_times_rate_to_the_nearest(void **state)
{
    struct chirp c = up;

    (void)state;
    assert_int_equal(chirp_length(&up, RATE_HZ), N);
    c.duration_s = 2999.6 / RATE_HZ;
    assert_int_equal(chirp_length(&c, RATE_HZ), N);
    c.duration_s = 2999.4 / RATE_HZ;
    assert_int_equal(chirp_length(&c, RATE_HZ), N - 1);
    c.duration_s = -1.0;
    assert_int_equal(chirp_length(&c, RATE_HZ), 0);
    c.duration_s = NAN;
    assert_int_equal(chirp_length(&c, RATE_HZ), 0);
}

/* A central difference of a quadratic is exact. */
static void the_frequency_runs_linearly_from_start_to_stop(void **state)
{
    const double h = 1e-5;

    (void)state;
    for (int i = 0; i <= 10; i++) {
        double t = up.duration_s * i / 10.0;
        double hz = (chirp_phase_rad(&up, t + h) - chirp_phase_rad(&up, t - h)) /
                    (4.0 * M_PI * h);
        assert_near(hz, 2000.0 + 18000.0 * i / 10.0, 1e-3);
    }
}

static void samples_are_the_cosine_of_the_phase_to_the_last_bit_of_a_float(void **state)
{
    float x[N];

    (void)state;
    chirp_generate(&up, RATE_HZ, x);
    for (int i = 0; i < N; i++) {
        /* in long double, and with the phase reduced first */
        long double t = i / 48000.0L;
        long double cycles = 2000.0L * t + 144000.0L * t * t;
        long double y = cosl(2.0L * acosl(-1.0L) * (cycles - floorl(cycles)));
        assert_near(x[i], (float)y, 1.3e-7);
    }
}

static void a_sine_chirp_starts_at_zero_rising_and_a_cosine_at_one(void **state)
{
    struct chirp c = up;
    float x[N];

    (void)state;
    chirp_generate(&c, RATE_HZ, x);
    assert_near(x[0], 1.0, 1e-7);
    c.sine = true;
    chirp_generate(&c, RATE_HZ, x);
    assert_near(x[0], 0.0, 1e-7);
    assert_near(x[1], sin(2.0 * M_PI * (2000.0 / 48000.0 + 144000.0 / 48000.0 / 48000.0)),
                1e-6);
}

static void a_chirp_may_fall(void **state)
{
    struct chirp down = {20000.0, 2000.0, 0.0625, false};
    float x[N];

    (void)state;
    chirp_generate(&down, RATE_HZ, x);
    assert_near(
        x[1], cos(2.0 * M_PI * (20000.0 / 48000.0 - 144000.0 / 48000.0 / 48000.0)), 1e-6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_length_is_duration_times_rate_to_the_nearest),
        cmocka_unit_test(the_frequency_runs_linearly_from_start_to_stop),
        cmocka_unit_test(samples_are_the_cosine_of_the_phase_to_the_last_bit_of_a_float),
        cmocka_unit_test(a_sine_chirp_starts_at_zero_rising_and_a_cosine_at_one),
        cmocka_unit_test(a_chirp_may_fall),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
