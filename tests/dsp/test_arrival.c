/* SPDX-License-Identifier: MIT */
/* Arrivals against echoes at delays that are known exactly: the sampled chirp shifted by
 * a sinc in double precision (tests/dsp/echo.h). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "dsp/arrival.h"
#include "tests/dsp/echo.h"
#include "tests/dsp/near.h"

#define RATE_HZ 48000.0
#define N_PING  1400

static const struct sweep sweep = {RATE_HZ, 2000.0, 20000.0, 0.015625, 0.0};

struct bench {
    struct pulse_compress *pc;
    struct trace_format format;
    float *x;         /* [N_PING] */
    float complex *y; /* [format.n_samples] */
};

static void open_bench(struct bench *b)
{
    const struct pulse_compress_config cfg = {
        .sample_rate_hz = RATE_HZ,
        .n_samples = N_PING,
        .chirp = {2000.0, 20000.0, 0.015625, false},
        .window = WINDOW_HANN,
        .gate_s = {0.0, 600 / RATE_HZ},
        .oversampling = 8.0,
        .n_channels = 1,
    };
    assert_int_equal(pulse_compress_create(&b->pc, &cfg), 0);
    pulse_compress_format(b->pc, &b->format);
    b->x = calloc(N_PING, sizeof *b->x);
    b->y = calloc(b->format.n_samples, sizeof *b->y);
    assert_true(b->x && b->y);
}

static void compress(struct bench *b)
{
    pulse_compress_execute(b->pc, b->x, N_PING, b->y);
}

static void close_bench(struct bench *b)
{
    pulse_compress_destroy(b->pc);
    free(b->x);
    free(b->y);
}

static void echo(struct bench *b, double samples, double gain)
{
    echo_add_filtered(&sweep, b->x, N_PING, samples / RATE_HZ, gain);
}

static void a_delay_between_samples_is_found_to_a_hundredth(void **state)
{
    static const double at[] = {40.0, 123.25, 200.4999, 311.9, 480.0625};
    (void)state;
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        struct bench b;
        struct arrival a;
        open_bench(&b);
        echo(&b, at[i], 0.2);
        compress(&b);
        assert_true(arrival_strongest(&b.format, b.y, 0.0, 1.0, &a));
        assert_near(a.time_s * RATE_HZ, at[i], 0.01);
        assert_near(creal(a.peak), 0.2, 0.002);
        assert_near(cimag(a.peak), 0.0, 0.01);
        close_bench(&b);
    }
}

static void an_inverted_echo_peaks_below_zero(void **state)
{
    struct bench b;
    struct arrival a;
    (void)state;
    open_bench(&b);
    echo(&b, 77.3, -0.5);
    compress(&b);
    assert_true(arrival_strongest(&b.format, b.y, 0.0, 1.0, &a));
    assert_near(creal(a.peak), -0.5, 0.005);
    close_bench(&b);
}

static void the_first_arrival_need_not_be_the_strongest(void **state)
{
    struct bench b;
    struct arrival a;
    (void)state;
    open_bench(&b);
    echo(&b, 100.6, 0.2);
    echo(&b, 300.2, 1.0);
    compress(&b);
    assert_true(arrival_strongest(&b.format, b.y, 0.0, 1.0, &a));
    assert_near(a.time_s * RATE_HZ, 300.2, 0.02);
    assert_true(arrival_first(&b.format, b.y, 0.0, 1.0, 0.1, &a));
    assert_near(a.time_s * RATE_HZ, 100.6, 0.02);
    assert_true(arrival_first(&b.format, b.y, 0.0, 1.0, 0.5, &a));
    assert_near(a.time_s * RATE_HZ, 300.2, 0.02);
    close_bench(&b);
}

static void only_the_range_asked_for_is_looked_at(void **state)
{
    struct bench b;
    struct arrival a;
    (void)state;
    open_bench(&b);
    echo(&b, 100.0, 1.0);
    echo(&b, 300.0, 0.3);
    compress(&b);
    assert_true(arrival_strongest(&b.format, b.y, 250 / RATE_HZ, 350 / RATE_HZ, &a));
    assert_near(a.time_s * RATE_HZ, 300.0, 0.02);
    assert_false(arrival_first(&b.format, b.y, 250 / RATE_HZ, 350 / RATE_HZ, 0.5, &a));
    assert_false(arrival_strongest(&b.format, b.y, 0.5, 0.6, &a)); /* beyond the trace */
    assert_false(arrival_strongest(&b.format, b.y, 0.01, 0.005, &a));
    close_bench(&b);
}

static void silence_has_no_arrival(void **state)
{
    struct bench b;
    struct arrival a;
    (void)state;
    open_bench(&b);
    compress(&b);
    assert_false(arrival_strongest(&b.format, b.y, 0.0, 1.0, &a));
    assert_false(arrival_first(&b.format, b.y, 0.0, 1.0, 0.0, &a));
    close_bench(&b);
}

static void the_floor_is_the_median_amplitude(void **state)
{
    const struct trace_format f = {.rate_hz = 1.0, .n_samples = 5};
    const float complex y[5] = {3.0f, 1.0f * I, -2.0f, 100.0f, 0.0f};
    float scratch[5];
    (void)state;
    assert_near(arrival_floor(&f, y, scratch), 2.0, 1e-6);
}

/* Samples at 0, 1, 2 ... ms from 10 ms on, with powers of 0, 1, 4 ... */
static void the_highest_power_is_that_of_samples_within(void **state)
{
    static const struct trace_format f = {
        .t0_s = 0.01, .rate_hz = 1000.0, .n_samples = 8};
    float complex y[8];

    (void)state;
    for (int i = 0; i < 8; i++)
        y[i] = (float)i * (i % 2 ? I : -1.0f);
    assert_near(arrival_power(&f, y, 0.0115, 0.0145), 16.0, 1e-6);
    assert_near(arrival_power(&f, y, 0.0121, 0.0129), 0.0, 1e-6);
    assert_near(arrival_power(&f, y, -1.0, 1.0), 49.0, 1e-6);
    assert_near(arrival_power(&f, y, 0.0165, 0.02), 49.0, 1e-6);
    assert_near(arrival_power(&f, y, 0.02, 0.03), 0.0, 1e-6);
    assert_near(arrival_power(&f, y, -0.02, 0.0), 0.0, 1e-6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_delay_between_samples_is_found_to_a_hundredth),
        cmocka_unit_test(an_inverted_echo_peaks_below_zero),
        cmocka_unit_test(the_first_arrival_need_not_be_the_strongest),
        cmocka_unit_test(only_the_range_asked_for_is_looked_at),
        cmocka_unit_test(silence_has_no_arrival),
        cmocka_unit_test(the_floor_is_the_median_amplitude),
        cmocka_unit_test(the_highest_power_is_that_of_samples_within),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
