/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>

#include "dsp/timescale.h"
#include "tests/dsp/near.h"

#define N 600

static const struct trace_format format = {
    .t0_s = 0.004, .rate_hz = 36000.0, .carrier_hz = 11000.0, .n_samples = N};

struct bench {
    struct interpolator *ip;
    struct timescale *ts;
};

static void bench_open(struct bench *b)
{
    assert_int_equal(interpolator_create(&b->ip, 0.5), 0);
    assert_int_equal(timescale_create(&b->ts, &format, b->ip), 0);
}

static void bench_close(struct bench *b)
{
    timescale_destroy(b->ts);
    interpolator_destroy(b->ip);
}

static double shrunk_s(size_t n, double stretch)
{
    return (format.t0_s + (double)n / format.rate_hz) / (1.0 + stretch);
}

static void a_tone_is_read_at_the_shrunk_time_with_its_slope(void **state)
{
    static const double stretches[] = {0.0, 1e-3, -4e-3};
    const double turn = 2.0 * M_PI * 0.17; /* per sample */
    struct bench b;

    (void)state;
    bench_open(&b);
    for (size_t i = 0; i < 3; i++) {
        float x[N], value[N], slope[N];
        size_t first, end;
        for (size_t n = 0; n < N; n++)
            x[n] = (float)cos(turn * (double)n);
        timescale_set(b.ts, stretches[i]);
        timescale_range(b.ts, &first, &end);
        assert_true(first <= 4 && end >= N - 8);
        timescale_execute(b.ts, x, value, slope);
        for (size_t n = first; n < end; n++) {
            double at = (shrunk_s(n, stretches[i]) - format.t0_s) * format.rate_hz;
            assert_near(value[n], cos(turn * at), 5e-4);
            assert_near(slope[n], -turn * sin(turn * at), 2e-3);
        }
    }
    bench_close(&b);
}

static void the_carrier_turns_with_the_delay(void **state)
{
    const double stretch = -2.3e-3;
    struct bench b;

    (void)state;
    bench_open(&b);
    timescale_set(b.ts, stretch);
    for (size_t n = 0; n < N; n++) {
        double t = shrunk_s(n, 0.0), u = shrunk_s(n, stretch);
        double a = 2.0 * M_PI * format.carrier_hz * (u - t);
        assert_near(timescale_cosines(b.ts)[n], cos(a), 1e-6);
        assert_near(timescale_sines(b.ts)[n], sin(a), 1e-6);
    }
    bench_close(&b);
}

static void the_slope_is_how_the_shrunk_time_changes(void **state)
{
    const double h = 1e-6;
    struct bench b;

    (void)state;
    bench_open(&b);
    timescale_set(b.ts, 1e-3);
    for (size_t n = 0; n < N; n++) {
        double change = shrunk_s(n, 1e-3 + h) - shrunk_s(n, 1e-3 - h);
        assert_near(timescale_slopes(b.ts)[n], change / (2.0 * h) * format.rate_hz, 1e-3);
    }
    bench_close(&b);
}

static void a_trace_shorter_than_the_taps_has_no_range(void **state)
{
    const struct trace_format five = {0.004, 36000.0, 11000.0, 5};
    struct timescale *ts = NULL;
    struct interpolator *ip;
    size_t first, end;

    (void)state;
    assert_int_equal(interpolator_create(&ip, 0.5), 0);
    assert_int_equal(timescale_create(&ts, &five, NULL), -EINVAL);
    assert_int_equal(timescale_create(&ts, &five, ip), 0);
    timescale_set(ts, 1e-3);
    timescale_range(ts, &first, &end);
    assert_true(first == end && end <= 5);
    timescale_destroy(ts);
    interpolator_destroy(ip);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tone_is_read_at_the_shrunk_time_with_its_slope),
        cmocka_unit_test(the_carrier_turns_with_the_delay),
        cmocka_unit_test(the_slope_is_how_the_shrunk_time_changes),
        cmocka_unit_test(a_trace_shorter_than_the_taps_has_no_range),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
