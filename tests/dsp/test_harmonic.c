/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "dsp/arrival.h"
#include "dsp/chirp.h"
#include "tests/dsp/near.h"

#define RATE_HZ 48000.0

static const struct chirp chirp = {2000.0, 20000.0, 0.0625, false};

static void the_overtone_runs_as_many_times_as_high(void **state)
{
    struct chirp h;
    (void)state;
    assert_int_equal(harmonic_chirp(&chirp, 3, 21600.0, RATE_HZ, &h), 0);
    assert_near(h.start_hz, 6000.0, 1e-9);
    assert_true(h.stop_hz <= 21600.0 && h.stop_hz > 21580.0);
    /* 3 f(t) at every t: three times the phase */
    for (double t = 0.0; t < h.duration_s; t += 1e-3)
        assert_near(cos(chirp_phase_rad(&h, t)), cos(3.0 * chirp_phase_rad(&chirp, t)),
                    1e-6);
}

static void a_chirp_that_falls_or_starts_too_high_has_none(void **state)
{
    const struct chirp falls = {20000.0, 2000.0, 0.0625, false};
    const struct chirp high = {10000.0, 20000.0, 0.0625, false};
    struct chirp h;
    (void)state;
    assert_int_equal(harmonic_chirp(&falls, 3, 21600.0, RATE_HZ, &h), -ERANGE);
    assert_int_equal(harmonic_chirp(&high, 3, 21600.0, RATE_HZ, &h), -ERANGE);
}

/* cos clipped at half its height: the Fourier integrals of the first and third. */
static double third_over_first(double limit)
{
    double first = 0.0, third = 0.0;
    for (int i = 0; i < 100000; i++) {
        double a = 2.0 * M_PI * i / 100000.0;
        double x = fmax(-limit, fmin(limit, cos(a)));
        first += x * cos(a);
        third += x * cos(3.0 * a);
    }
    return fabs(third / first);
}

static double measure(const float *x, size_t n, const struct chirp *c)
{
    const struct pulse_compress_config cfg = {.sample_rate_hz = RATE_HZ,
                                              .n_samples = n,
                                              .chirp = *c,
                                              .window = WINDOW_HANN,
                                              .gate_s = {0.0, 600 / RATE_HZ},
                                              .oversampling = 4.0,
                                              .n_channels = 1};
    struct pulse_compress *pc;
    struct trace_format f;
    struct arrival a;
    assert_int_equal(pulse_compress_create(&pc, &cfg), 0);
    pulse_compress_format(pc, &f);
    float complex *y = malloc(f.n_samples * sizeof *y);
    assert_non_null(y);
    pulse_compress_execute(pc, x, n, y);
    assert_true(arrival_strongest(&f, y, 290 / RATE_HZ, 310 / RATE_HZ, &a));
    free(y);
    pulse_compress_destroy(pc);
    return cabs(a.peak);
}

static void a_clipped_chirp_has_the_overtone_of_its_waveform(void **state)
{
    enum { N = 4000, AT = 300 };
    float *x = calloc(N, sizeof *x), *sent = calloc(N, sizeof *sent);
    struct chirp h;
    (void)state;
    assert_non_null(x);
    assert_non_null(sent);
    chirp_generate(&chirp, RATE_HZ, sent);
    assert_int_equal(harmonic_chirp(&chirp, 3, 21600.0, RATE_HZ, &h), 0);
    for (size_t i = 0; i < 3000; i++)
        x[AT + i] = 0.2f * sent[i];
    assert_true(measure(x, N, &h) < 0.01 * measure(x, N, &chirp));
    for (size_t i = 0; i < 3000; i++)
        x[AT + i] = 0.2f * fmaxf(-0.5f, fminf(0.5f, sent[i]));
    double ratio = measure(x, N, &h) / measure(x, N, &chirp);
    assert_near(ratio, third_over_first(0.5), 0.03);
    free(x);
    free(sent);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_overtone_runs_as_many_times_as_high),
        cmocka_unit_test(a_chirp_that_falls_or_starts_too_high_has_none),
        cmocka_unit_test(a_clipped_chirp_has_the_overtone_of_its_waveform),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
