/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/deramp.h"
#include "tests/dsp/echo.h"
#include "tests/worse.h"

#define RATE_HZ 48000.0
#define N_PING  6144 /* of which a standard ping takes 4200 */

static const struct sweep rising = {RATE_HZ, 2000.0, 20000.0, 0.0625, 0.0};
static const struct deramp_config standard = {
    .sample_rate_hz = RATE_HZ,
    .n_samples = 4200,
    .chirp = {2000.0, 20000.0, 0.0625, false},
    .window = WINDOW_HANN,
    .gate_s = {0.006, 0.025},
    .n_channels = 1,
    .rate_hz = 144000.0,
};

struct bench {
    struct deramp *d;
    struct trace_format f;
    float x[N_PING];
    float complex *y;
};

static void bench_open(struct bench *b, const struct deramp_config *cfg)
{
    assert_int_equal(deramp_create(&b->d, cfg), 0);
    deramp_format(b->d, &b->f);
    memset(b->x, 0, sizeof(b->x));
    b->y = calloc(b->f.n_samples, sizeof(*b->y));
    assert_non_null(b->y);
}

static void bench_close(struct bench *b)
{
    deramp_destroy(b->d);
    free(b->y);
}

static void bench_echo(struct bench *b, const struct sweep *s, double start_s,
                       double gain)
{
    memset(b->x, 0, sizeof(b->x));
    echo_add(s, b->x, N_PING, start_s, gain);
    deramp_execute(b->d, b->x, N_PING, b->y);
}

static size_t peak(const struct bench *b)
{
    size_t at = 0;

    for (size_t n = 1; n < b->f.n_samples; n++)
        if (cabsf(b->y[n]) > cabsf(b->y[at]))
            at = n;
    return at;
}

static double sample_time(const struct bench *b, size_t n)
{
    return b->f.t0_s + (double)n / b->f.rate_hz;
}

static double complex analytic(const struct bench *b, size_t n)
{
    return b->y[n] * cexp(2.0 * M_PI * I * b->f.carrier_hz * sample_time(b, n));
}

/* Peak within a range bin, magnitude 1 within 2 %, phase 0 once the distance from the
 * bin to the echo is turned back at the carrier. */
static void check_echo(struct bench *b, double tau, double gain)
{
    size_t n = peak(b);
    double off = sample_time(b, n) - tau;
    double complex z = analytic(b, n) * cexp(-2.0 * M_PI * I * b->f.carrier_hz * off);

    assert_true(fabs(off) <= 1.0 / b->f.rate_hz);
    assert_true(fabs(cabs(z) - gain) < 0.02 * gain);
    assert_true(fabs(carg(z)) < 0.1);
}

static void the_format_is_on_range_bins_inside_the_gate(void **state)
{
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    assert_true(b.f.rate_hz >= 144000.0 * 0.999 && b.f.rate_hz < 144000.0 * 1.06);
    assert_true(b.f.t0_s >= 0.006 - 1e-9 && b.f.t0_s < 0.006 + 1.0 / b.f.rate_hz);
    assert_true(sample_time(&b, b.f.n_samples - 1) <= 0.025 + 1e-9);
    assert_true(sample_time(&b, b.f.n_samples) > 0.025);
    bench_close(&b);
}

static void an_echo_peaks_at_its_delay_with_magnitude_one_and_phase_zero(void **state)
{
    static const double samples[] = {320.0, 500.0, 777.25, 1000.7, 1180.0};
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    for (size_t i = 0; i < sizeof(samples) / sizeof(*samples); i++) {
        bench_echo(&b, &rising, samples[i] / RATE_HZ, 1.0);
        check_echo(&b, samples[i] / RATE_HZ, 1.0);
    }
    bench_close(&b);
}

static void latency_is_taken_out_fractions_too(void **state)
{
    struct deramp_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.latency_samples = 31.37;
    bench_open(&b, &cfg);
    bench_echo(&b, &rising, (600.0 + 31.37) / RATE_HZ, 0.01);
    check_echo(&b, 600.0 / RATE_HZ, 0.01);
    bench_close(&b);
}

static void a_falling_chirp_and_a_sine_work_too(void **state)
{
    struct deramp_config cfg = standard;
    struct sweep s = {RATE_HZ, 20000.0, 2000.0, 0.0625, -M_PI / 2.0};
    struct bench b;

    (void)state;
    cfg.chirp = (struct chirp){20000.0, 2000.0, 0.0625, true};
    bench_open(&b, &cfg);
    bench_echo(&b, &s, 0.0125, 1.0);
    check_echo(&b, 0.0125, 1.0);
    bench_close(&b);
}

/* The largest deviation from the window's transform around mid-band, out to four times
 * the width of the pulse. */
static double deviation(const struct bench *b, double tau)
{
    double worst = 0.0;

    for (size_t n = 0; n < b->f.n_samples; n++) {
        double off = sample_time(b, n) - tau;
        if (fabs(off) * 18000.0 < 8.0)
            worst = worse(worst, cabs(analytic(b, n) - hann_pulse(2000.0, 20000.0, off)));
    }
    return worst;
}

/* The pulse and its phase are those of the whole band under the window, whenever the echo
 * comes. */
static void late_echoes_have_the_same_band_as_early_ones(void **state)
{
    static const double delays_s[] = {0.0065, 0.0101, 0.0155, 0.0203, 0.0246};
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    for (size_t i = 0; i < sizeof(delays_s) / sizeof(*delays_s); i++) {
        bench_echo(&b, &rising, delays_s[i], 1.0);
        assert_true(deviation(&b, delays_s[i]) < 1e-4);
    }
    bench_close(&b);
}

/* Three taps, symmetric, so without phase: 1 + 2 a cos(2 pi f / fs). */
static void microphones_are_equalised(void **state)
{
    enum { POINTS = 200 };
    static double f_hz[POINTS], gain_db[POINTS];
    const struct microphone curve = {POINTS, f_hz, gain_db};
    const struct microphone *const one[] = {&curve};
    struct deramp_config cfg = standard;
    double a = 0.4, tau = 0.0187;
    float x[N_PING] = {0};
    struct bench b;

    (void)state;
    for (int i = 0; i < POINTS; i++) {
        f_hz[i] = 1000.0 + 100.0 * i;
        gain_db[i] = 20.0 * log10(1.0 + 2.0 * a * cos(2.0 * M_PI * f_hz[i] / RATE_HZ));
    }
    for (int flat = 0; flat < 2; flat++) {
        cfg.microphones = flat ? NULL : one;
        bench_open(&b, &cfg);
        echo_add(&rising, b.x, N_PING, tau, 1.0);
        for (int i = 1; i + 1 < N_PING; i++)
            x[i] = b.x[i] + (float)a * (b.x[i - 1] + b.x[i + 1]);
        deramp_execute(b.d, x, N_PING, b.y);
        assert_true(flat ? deviation(&b, tau) > 0.05 : deviation(&b, tau) < 1e-4);
        bench_close(&b);
    }
}

static double loudest(const struct bench *b)
{
    return cabsf(b->y[peak(b)]);
}

/* Unit echoes before and behind the gate, the end of the emission that went before, and
 * the whole of the next one: what is cut by the ping's ends is a click. */
static void what_is_outside_the_gate_stays_outside(void **state)
{
    static const struct {
        double start_s, level;
    } sounds[] = {{0.001, 1e-5},          {0.004, 1e-4},          {0.03, 1e-5},
                  {0.035, 1e-5},          {0.010 - 0.0625, 1e-3}, {0.020 - 0.0625, 1e-3},
                  {0.0625 + 0.001, 1e-4}, {0.0625 + 0.002, 1e-4}};
    struct deramp_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.n_samples = N_PING;
    bench_open(&b, &cfg);
    for (size_t i = 0; i < sizeof(sounds) / sizeof(*sounds); i++) {
        bench_echo(&b, &rising, sounds[i].start_s, 1.0);
        assert_true(loudest(&b) < sounds[i].level);
    }
    bench_close(&b);
}

/* Of a ping without a tail, an echo at 20 ms has lost a third of its chirp. */
static void an_echo_that_the_ping_cuts_off_keeps_its_place_and_height(void **state)
{
    struct deramp_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.n_samples = 3000;
    bench_open(&b, &cfg);
    bench_echo(&b, &rising, 0.0201, 1.0);
    assert_true(fabs(sample_time(&b, peak(&b)) - 0.0201) <= 1.0 / b.f.rate_hz);
    assert_true(fabs(loudest(&b) - 1.0) < 0.02);
    bench_close(&b);
}

static void deramping_is_linear(void **state)
{
    struct bench b;
    float complex sum[16];
    float x[N_PING];

    (void)state;
    bench_open(&b, &standard);
    bench_echo(&b, &rising, 0.01, 1.0);
    memcpy(sum, b.y + 500, sizeof(sum));
    memcpy(x, b.x, sizeof(x));
    bench_echo(&b, &rising, 0.011, 0.5);
    for (int i = 0; i < 16; i++)
        sum[i] += b.y[500 + i];
    for (int i = 0; i < N_PING; i++)
        x[i] += b.x[i];
    deramp_execute(b.d, x, N_PING, b.y);
    for (int i = 0; i < 16; i++)
        assert_true(cabsf(b.y[500 + i] - sum[i]) < 1e-6f);
    bench_close(&b);
}

static void channels_are_taken_in_turn(void **state)
{
    struct deramp_config cfg = standard;
    static float x[2 * (N_PING + 8)];
    struct deramp *d;
    struct trace_format f;
    float complex *y;

    (void)state;
    cfg.n_channels = 2;
    assert_int_equal(deramp_create(&d, &cfg), 0);
    deramp_format(d, &f);
    y = calloc(2 * f.n_samples, sizeof(*y));
    assert_non_null(y);
    echo_add(&rising, x + N_PING + 8, N_PING, 0.015, 1.0);
    deramp_execute(d, x, N_PING + 8, y);
    for (size_t n = 0; n < f.n_samples; n++)
        assert_true(cabsf(y[n]) == 0.0f);
    assert_true(cabsf(y[f.n_samples + (size_t)((0.015 - f.t0_s) * f.rate_hz)]) > 0.9f);
    deramp_destroy(d);
    free(y);
}

static void a_gate_that_the_ping_hardly_hears_is_refused(void **state)
{
    struct deramp_config cfg = standard;
    struct deramp *d = NULL;

    (void)state;
    cfg.gate_s[1] = 0.062;
    cfg.n_samples = 3100;
    assert_int_equal(deramp_create(&d, &cfg), -ERANGE);
    cfg = standard;
    cfg.latency_samples = 4199.0;
    assert_int_equal(deramp_create(&d, &cfg), -ERANGE);
    assert_null(d);
}

/* A ping of half a chirp still hears an early echo, with the lower half of the band. */
static void a_ping_shorter_than_the_chirp_is_taken_as_it_is(void **state)
{
    struct deramp_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.n_samples = 1500;
    cfg.gate_s[1] = 0.01;
    bench_open(&b, &cfg);
    bench_echo(&b, &rising, 0.0081, 1.0);
    assert_true(fabs(sample_time(&b, peak(&b)) - 0.0081) <= 1.0 / b.f.rate_hz);
    assert_true(fabs(loudest(&b) - 1.0) < 0.02);
    bench_close(&b);
}

/* Its beats reach 50 kHz, beyond the sample rate. */
static void a_steep_chirp_works_until_its_beats_are_too_many(void **state)
{
    static const struct sweep steep = {RATE_HZ, 2000.0, 20000.0, 0.009, 0.0};
    struct deramp_config cfg = standard;
    struct deramp *d = NULL;
    struct bench b;

    (void)state;
    cfg.chirp.duration_s = 0.009;
    bench_open(&b, &cfg);
    bench_echo(&b, &steep, 0.0203, 1.0);
    assert_true(deviation(&b, 0.0203) < 1e-3);
    bench_close(&b);
    cfg.chirp.duration_s = 0.0004;
    assert_int_equal(deramp_create(&d, &cfg), -ERANGE);
    assert_null(d);
}

static void nonsense_is_refused(void **state)
{
    struct deramp *d = NULL;

#define REFUSED(field, value)                                                            \
    do {                                                                                 \
        struct deramp_config cfg = standard;                                             \
        cfg.field = (value);                                                             \
        assert_int_equal(deramp_create(&d, &cfg), -EINVAL);                              \
        assert_null(d);                                                                  \
    } while (0)
    (void)state;
    REFUSED(sample_rate_hz, NAN);
    REFUSED(n_samples, 0);
    REFUSED(n_channels, 0);
    REFUSED(chirp.stop_hz, 2000.0);
    REFUSED(chirp.duration_s, 0.0);
    REFUSED(latency_samples, -1.0);
    REFUSED(gate_s[0], 0.03);
    REFUSED(gate_s[1], NAN);
    REFUSED(rate_hz, 0.0);
    REFUSED(rate_hz, 1e9);
#undef REFUSED
    assert_int_equal(deramp_create(NULL, &standard), -EINVAL);
    deramp_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_format_is_on_range_bins_inside_the_gate),
        cmocka_unit_test(an_echo_peaks_at_its_delay_with_magnitude_one_and_phase_zero),
        cmocka_unit_test(latency_is_taken_out_fractions_too),
        cmocka_unit_test(a_falling_chirp_and_a_sine_work_too),
        cmocka_unit_test(late_echoes_have_the_same_band_as_early_ones),
        cmocka_unit_test(microphones_are_equalised),
        cmocka_unit_test(what_is_outside_the_gate_stays_outside),
        cmocka_unit_test(an_echo_that_the_ping_cuts_off_keeps_its_place_and_height),
        cmocka_unit_test(deramping_is_linear),
        cmocka_unit_test(channels_are_taken_in_turn),
        cmocka_unit_test(a_ping_shorter_than_the_chirp_is_taken_as_it_is),
        cmocka_unit_test(a_gate_that_the_ping_hardly_hears_is_refused),
        cmocka_unit_test(a_steep_chirp_works_until_its_beats_are_too_many),
        cmocka_unit_test(nonsense_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
