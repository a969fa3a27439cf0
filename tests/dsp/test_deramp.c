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

#define RATE_HZ 48000.0
#define N_PING  4200

static const struct sweep rising = {RATE_HZ, 2000.0, 20000.0, 0.0625, 0.0};
static const struct deramp_config standard = {
    .sample_rate_hz = RATE_HZ,
    .n_samples = N_PING,
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

/* Around an echo, the phase runs at the frequencies that were emitted, as it does after
 * pulse compression: the quadratic phase of the mixing is gone. */
static void the_phase_runs_at_the_carrier(void **state)
{
    double tau = 0.0155;
    struct bench b;
    size_t n;

    (void)state;
    bench_open(&b, &standard);
    bench_echo(&b, &rising, tau, 1.0);
    n = peak(&b);
    for (size_t i = n - 3; i <= n + 3; i++) {
        double off = sample_time(&b, i) - tau;
        double complex z = analytic(&b, i) * cexp(-2.0 * M_PI * I * b.f.carrier_hz * off);
        assert_true(fabs(carg(z)) < 0.15);
    }
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

static void a_gate_that_the_slot_hardly_hears_is_refused(void **state)
{
    struct deramp_config cfg = standard;
    struct deramp *d = NULL;

    (void)state;
    cfg.gate_s[1] = 0.062;
    assert_int_equal(deramp_create(&d, &cfg), -ERANGE);
    cfg = standard;
    cfg.latency_samples = 4200.0;
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
        cmocka_unit_test(the_phase_runs_at_the_carrier),
        cmocka_unit_test(deramping_is_linear),
        cmocka_unit_test(channels_are_taken_in_turn),
        cmocka_unit_test(a_gate_that_the_slot_hardly_hears_is_refused),
        cmocka_unit_test(nonsense_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
