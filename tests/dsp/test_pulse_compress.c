/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/pulse_compress.h"
#include "tests/dsp/echo.h"
#include "tests/dsp/near.h"
#include "tests/worse.h"

#define RATE_HZ   48000.0
#define N_REPLICA 3000
#define N_PING    4200

static const struct sweep cosine = {RATE_HZ, 2000.0, 20000.0, 0.0625, 0.0};
static const struct pulse_compress_config standard = {
    .sample_rate_hz = RATE_HZ,
    .n_samples = N_PING,
    .chirp = {2000.0, 20000.0, 0.0625, false},
    .window = WINDOW_HANN,
    .gate_s = {0.006, 0.025},
    .oversampling = 2.0,
    .n_channels = 1,
};

/* A compressor with its ping and its traces. */
struct bench {
    struct pulse_compress *pc;
    struct trace_format f;
    size_t n_channels, stride;
    float *x;         /* [n_channels][stride] */
    float complex *y; /* [n_channels][f.n_samples] */
};

static void bench_open(struct bench *b, const struct pulse_compress_config *cfg)
{
    assert_int_equal(pulse_compress_create(&b->pc, cfg), 0);
    pulse_compress_format(b->pc, &b->f);
    b->n_channels = cfg->n_channels;
    b->stride = cfg->n_samples;
    b->x = calloc(b->n_channels * b->stride, sizeof(*b->x));
    b->y = calloc(b->n_channels * b->f.n_samples, sizeof(*b->y));
    assert_true(b->x && b->y);
}

static void bench_run(struct bench *b)
{
    pulse_compress_execute(b->pc, b->x, b->stride, b->y);
}

static void bench_close(struct bench *b)
{
    pulse_compress_destroy(b->pc);
    free(b->x);
    free(b->y);
}

static double sample_time(const struct bench *b, size_t n)
{
    return b->f.t0_s + (double)n / b->f.rate_hz;
}

static double complex analytic(const struct bench *b, size_t channel, size_t n)
{
    float complex y = b->y[channel * b->f.n_samples + n];

    return y * cexp(2.0 * M_PI * I * b->f.carrier_hz * sample_time(b, n));
}

/* Largest distance of a channel from what an echo of that delay and gain should give. */
static double worst_error(const struct bench *b, size_t channel, double tau, double gain)
{
    double worst = 0.0;

    for (size_t n = 0; n < b->f.n_samples; n++) {
        double complex want = gain * hann_pulse(2000.0, 20000.0, sample_time(b, n) - tau);
        worst = worse(worst, cabs(analytic(b, channel, n) - want));
    }
    return worst;
}

/* The delay at which the ideal pulse fits the trace best. */
static double fitted_delay(const struct bench *b, double tau)
{
    double best = -1.0, at = 0.0;

    for (int i = -100; i <= 100; i++) {
        double guess = tau + i * 0.005 / RATE_HZ;
        double complex sum = 0.0;
        for (size_t n = 0; n < b->f.n_samples; n++)
            sum += analytic(b, 0, n) *
                   conj(hann_pulse(2000.0, 20000.0, sample_time(b, n) - guess));
        if (creal(sum) > best) {
            best = creal(sum);
            at = guess;
        }
    }
    return at;
}

static double largest(const struct bench *b)
{
    double max = 0.0;

    for (size_t n = 0; n < b->n_channels * b->f.n_samples; n++)
        max = worse(max, cabsf(b->y[n]));
    return max;
}

static float noise(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (float)(*seed >> 8) / 8388608.0f - 1.0f;
}

static void the_format_covers_the_gate_just_above_the_band(void **state)
{
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    assert_near(b.f.t0_s, 0.006, 1e-12);
    assert_true(b.f.rate_hz >= 36000.0 * 0.998 && b.f.rate_hz <= 36000.0 * 1.25);
    assert_true(b.f.carrier_hz > 10500.0 && b.f.carrier_hz < 11500.0);
    assert_true(sample_time(&b, b.f.n_samples - 1) <= 0.025 + 1e-9);
    assert_true(sample_time(&b, b.f.n_samples) > 0.025);
    bench_close(&b);
}

/* The same delays and samples as without, and beside them what came before the gate and
 * comes after it. */
static void a_reach_adds_to_the_gate_and_leaves_it_as_it_is(void **state)
{
    struct pulse_compress_config cfg = standard;
    const double echoes_s[] = {0.0011, 0.014, 0.0255};
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    for (int k = 0; k < 3; k++)
        echo_add(&cosine, b.x, N_PING, echoes_s[k], 0.5);
    bench_run(&b);
    cfg.reach_s = 0.0258;
    struct pulse_compress *pc;
    struct trace_format whole, gate;
    size_t first;
    assert_int_equal(pulse_compress_create(&pc, &cfg), 0);
    pulse_compress_format(pc, &gate);
    assert_memory_equal(&gate, &b.f, sizeof gate);
    pulse_compress_whole(pc, &whole, &first);
    assert_near(whole.t0_s + (double)first / whole.rate_hz, gate.t0_s, 1e-12);
    assert_true(whole.t0_s >= 0.0 && whole.t0_s * whole.rate_hz < 1.0);
    assert_true(whole.t0_s + (double)whole.n_samples / whole.rate_hz > cfg.reach_s);
    float complex *y = calloc(whole.n_samples, sizeof *y);
    assert_non_null(y);
    pulse_compress_execute(pc, b.x, b.stride, y);
    for (size_t n = 0; n < gate.n_samples; n++)
        assert_true(cabsf(y[first + n] - b.y[n]) < 1e-5f);
    for (size_t n = 0; n < whole.n_samples; n++) {
        double t = whole.t0_s + (double)n / whole.rate_hz;
        double complex want = 0.0;
        for (int k = 0; k < 3; k++)
            want += 0.5 * hann_pulse(2000.0, 20000.0, t - echoes_s[k]);
        double complex is = y[n] * cexp(2.0 * M_PI * I * whole.carrier_hz * t);
        assert_true(cabs(is - want) < 0.01);
    }
    free(y);
    pulse_compress_destroy(pc);
    cfg.reach_s = 0.0876; /* after the ping */
    assert_int_equal(pulse_compress_create(&pc, &cfg), -ERANGE);
    bench_close(&b);
}

/* Whole samples, fractions, near the gate's ends, gains. */
static void an_echo_is_the_windows_transform_at_its_delay(void **state)
{
    static const double samples[] = {300.0, 500.0, 612.5, 777.21, 1000.9, 1190.0};
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    for (size_t i = 0; i < sizeof(samples) / sizeof(*samples); i++) {
        double tau = samples[i] / RATE_HZ, gain = i % 2 ? 1.0 : -0.01;
        memset(b.x, 0, N_PING * sizeof(*b.x));
        echo_add(&cosine, b.x, N_PING, tau, gain);
        bench_run(&b);
        assert_true(worst_error(&b, 0, tau, gain) < 2e-3 * fabs(gain));
    }
    bench_close(&b);
}

static void an_echo_peaks_at_its_delay_to_a_fiftieth_of_a_sample(void **state)
{
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    for (int i = 0; i < 4; i++) {
        double tau = (700.0 + 0.27 * i) / RATE_HZ;
        memset(b.x, 0, N_PING * sizeof(*b.x));
        echo_add(&cosine, b.x, N_PING, tau, 1.0);
        bench_run(&b);
        assert_true(fabs(fitted_delay(&b, tau) - tau) < 0.02 / RATE_HZ);
    }
    bench_close(&b);
}

static void a_sine_chirp_gives_the_same_pulse(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct sweep sine = cosine;
    struct bench b;

    (void)state;
    cfg.chirp.sine = true;
    sine.phase_rad = -M_PI / 2.0;
    bench_open(&b, &cfg);
    echo_add(&sine, b.x, N_PING, 0.0125, 1.0);
    bench_run(&b);
    assert_true(worst_error(&b, 0, 0.0125, 1.0) < 2e-3);
    bench_close(&b);
}

static void latency_is_taken_out_fractions_too(void **state)
{
    static const double latencies[] = {1.0, 12.37, 255.0, 0.5};
    struct pulse_compress_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.n_samples = N_PING + 256;
    for (size_t i = 0; i < sizeof(latencies) / sizeof(*latencies); i++) {
        double tau = 600.0 / RATE_HZ;
        cfg.latency_samples = latencies[i];
        bench_open(&b, &cfg);
        echo_add(&cosine, b.x, cfg.n_samples, tau + latencies[i] / RATE_HZ, 1.0);
        bench_run(&b);
        assert_near(b.f.t0_s, 0.006, 1e-12);
        assert_true(worst_error(&b, 0, tau, 1.0) < 2e-3);
        assert_true(fabs(fitted_delay(&b, tau) - tau) < 0.02 / RATE_HZ);
        bench_close(&b);
    }
}

static void compression_is_linear(void **state)
{
    struct bench a, b, c;
    unsigned seed = 1;

    (void)state;
    bench_open(&a, &standard);
    bench_open(&b, &standard);
    bench_open(&c, &standard);
    for (size_t i = 0; i < N_PING; i++) {
        a.x[i] = noise(&seed);
        b.x[i] = noise(&seed);
        c.x[i] = 2.0f * a.x[i] - 0.5f * b.x[i];
    }
    bench_run(&a);
    bench_run(&b);
    bench_run(&c);
    for (size_t n = 0; n < a.f.n_samples; n++)
        assert_true(cabsf(2.0f * a.y[n] - 0.5f * b.y[n] - c.y[n]) < 1e-6f);
    bench_close(&a);
    bench_close(&b);
    bench_close(&c);
}

/* Any signal, not only an echo: as much later as 3 trace samples and a whole number of
 * recording samples, it comes out 3 samples later with the carrier turned. */
static void a_later_signal_is_a_later_trace(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench a, b;
    unsigned seed = 5;
    size_t step = 0, shift;

    (void)state;
    bench_open(&a, &cfg);
    for (size_t n = 1; n <= 64 && !step; n++) {
        double samples = (double)n * RATE_HZ / a.f.rate_hz;
        if (fabs(samples - round(samples)) < 1e-9)
            step = n;
    }
    assert_true(step > 0);
    shift = (size_t)lround((double)step * RATE_HZ / a.f.rate_hz);
    bench_open(&b, &cfg);
    for (size_t i = 500; i < 3500; i++) {
        a.x[i] = noise(&seed);
        b.x[i + shift] = a.x[i];
    }
    bench_run(&a);
    bench_run(&b);
    for (size_t n = 0; n + step < a.f.n_samples; n++)
        assert_true(cabs(analytic(&a, 0, n) - analytic(&b, 0, n + step)) < 1e-6);
    bench_close(&a);
    bench_close(&b);
}

/* White noise of variance v comes out with 4 v / N times the window's noise bandwidth,
 * 1.5 for Hann: 6 v / N. */
static void noise_is_suppressed_by_the_chirps_energy(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench b;
    double power = 0.0, want = 6.0 / 3.0 / N_REPLICA; /* v = 1/3: uniform in -1..1 */
    unsigned seed = 3;

    (void)state;
    cfg.n_channels = 64;
    bench_open(&b, &cfg);
    for (size_t i = 0; i < cfg.n_channels * N_PING; i++)
        b.x[i] = noise(&seed);
    bench_run(&b);
    for (size_t n = 0; n < cfg.n_channels * b.f.n_samples; n++)
        power += cabsf(b.y[n]) * cabsf(b.y[n]);
    power /= (double)(cfg.n_channels * b.f.n_samples);
    assert_true(power > 0.93 * want && power < 1.07 * want);
    bench_close(&b);
}

/* A direct path 60 dB over the echoes, long before the gate, at any part of a sample. */
static void the_direct_path_stays_out_of_the_gate(void **state)
{
    static const double samples[] = {0.0, 14.0, 14.4, 100.5, 200.0};
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    for (size_t i = 0; i < sizeof(samples) / sizeof(*samples); i++) {
        memset(b.x, 0, N_PING * sizeof(*b.x));
        echo_add_filtered(&cosine, b.x, N_PING, samples[i] / RATE_HZ, 1000.0);
        bench_run(&b);
        assert_true(largest(&b) < 1000.0 * 1e-4);
    }
    bench_close(&b);
}

/* The next speaker's direct path starts in the tail and is cut off at its end: what is
 * left of the match between its sharp start and the replica's sharp end. */
static void the_next_emission_stays_58_db_down(void **state)
{
    struct bench b;

    (void)state;
    bench_open(&b, &standard);
    echo_add_filtered(&cosine, b.x, N_PING, 0.0625 + 0.0003, 1000.0);
    bench_run(&b);
    assert_true(largest(&b) < 1000.0 * 1.26e-3);
    bench_close(&b);
}

static void a_next_emission_that_is_heard_whole_stays_100_db_down(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.n_samples = 6100;
    bench_open(&b, &cfg);
    echo_add_filtered(&cosine, b.x, cfg.n_samples, 0.0625 + 0.0003, 1000.0);
    bench_run(&b);
    assert_true(largest(&b) < 1000.0 * 1e-5);
    bench_close(&b);
}

static void sidelobes_are_those_of_the_window(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench b;
    double tau = 0.015, first = 0.0, far = 0.0;

    (void)state;
    cfg.oversampling = 8.0;
    bench_open(&b, &cfg);
    echo_add(&cosine, b.x, N_PING, tau, 1.0);
    bench_run(&b);
    for (size_t n = 0; n < b.f.n_samples; n++) {
        double x = 18000.0 * fabs(sample_time(&b, n) - tau), level = cabsf(b.y[n]);
        if (x > 2.0)
            first = worse(first, level);
        if (x > 10.0)
            far = worse(far, level);
    }
    assert_true(fabs(20.0 * log10(first) + 31.5) < 0.5);
    assert_true(20.0 * log10(far) < -58.0); /* 1 / (pi 10.5 (10.5^2 - 1)) is -71 */
    bench_close(&b);
}

static void a_rectangular_window_is_narrower_and_still_one(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench b;
    double tau = 0.006 + 0.008, peak = 0.0;

    (void)state;
    cfg.window = WINDOW_RECTANGULAR;
    bench_open(&b, &cfg);
    echo_add(&cosine, b.x, N_PING, tau, 1.0);
    bench_run(&b);
    for (size_t n = 0; n < b.f.n_samples; n++) {
        double x = 18000.0 * (sample_time(&b, n) - tau);
        double want = fabs(x) < 1e-9 ? 1.0 : fabs(sin(M_PI * x) / (M_PI * x));
        assert_true(fabs(cabsf(b.y[n]) - want) < 0.02);
        peak = fmax(peak, cabsf(b.y[n]));
    }
    assert_true(peak > 0.8);
    bench_close(&b);
}

/* Channels that share a transform do not hear each other, and the odd one out works. */
static void channels_are_independent(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.n_channels = 5;
    bench_open(&b, &cfg);
    echo_add(&cosine, b.x + 1 * N_PING, N_PING, 0.010, 1.0);
    echo_add(&cosine, b.x + 4 * N_PING, N_PING, 0.020, 1.0);
    bench_run(&b);
    assert_true(worst_error(&b, 1, 0.010, 1.0) < 2e-3);
    assert_true(worst_error(&b, 4, 0.020, 1.0) < 2e-3);
    for (size_t n = 0; n < b.f.n_samples; n++) {
        assert_true(cabsf(b.y[n]) < 1e-6f);
        assert_true(cabsf(b.y[2 * b.f.n_samples + n]) < 1e-6f);
        assert_true(cabsf(b.y[3 * b.f.n_samples + n]) < 1e-6f);
    }
    bench_close(&b);
}

/* A microphone that adds 0.3 of the samples before and after: its response is
 * 1 + 0.6 cos(2 pi f / rate), without phase. */
static void microphones_are_equalised(void **state)
{
    double f_hz[1000], gain_db[1000];
    struct microphone tilted = {1000, f_hz, gain_db};
    const struct microphone *microphones[] = {NULL, &tilted, &tilted};
    struct pulse_compress_config cfg = standard;
    struct bench b;

    (void)state;
    for (int i = 0; i < 1000; i++) {
        f_hz[i] = 1000.0 + 20.0 * i;
        gain_db[i] = 20.0 * log10(1.0 + 0.6 * cos(2.0 * M_PI * f_hz[i] / RATE_HZ));
    }
    cfg.n_channels = 3;
    cfg.microphones = microphones;
    bench_open(&b, &cfg);
    echo_add(&cosine, b.x, N_PING, 0.010, 1.0);
    for (int i = -1; i <= 1; i++)
        echo_add(&cosine, b.x + N_PING, N_PING, 0.012 + i / RATE_HZ, i ? 0.3 : 1.0);
    memcpy(b.x + 2 * N_PING, b.x + N_PING, N_PING * sizeof(*b.x));
    bench_run(&b);
    assert_true(worst_error(&b, 0, 0.010, 1.0) < 2e-3);
    assert_true(worst_error(&b, 1, 0.012, 1.0) < 3e-3);
    assert_true(worst_error(&b, 2, 0.012, 1.0) < 3e-3);
    bench_close(&b);
}

/* Channels by 16, the rest of them side by side too or one by one: each has an echo of
 * its own and, where they are not flat, a gain of its own. */
static void any_number_of_channels_is_any_channels_own(void **state)
{
    static const size_t numbers[] = {8, 9, 16, 21, 27, 40};
    double f_hz[] = {1000.0}, gain_db[40];
    struct microphone each[40];
    const struct microphone *microphones[40];

    (void)state;
    for (size_t i = 0; i < 40; i++) {
        gain_db[i] = -0.4 * (double)i;
        each[i] = (struct microphone){1, f_hz, &gain_db[i]};
        microphones[i] = &each[i];
    }
    for (size_t q = 0; q < 2 * sizeof(numbers) / sizeof(*numbers); q++) {
        struct pulse_compress_config cfg = standard;
        struct bench b;

        cfg.n_channels = numbers[q / 2];
        cfg.microphones = q % 2 ? microphones : NULL;
        bench_open(&b, &cfg);
        for (size_t i = 0; i < cfg.n_channels; i++)
            echo_add(&cosine, b.x + i * N_PING, N_PING, 0.008 + 4e-4 * (double)i, 1.0);
        bench_run(&b);
        for (size_t i = 0; i < cfg.n_channels; i++) {
            double gain = q % 2 ? pow(10.0, -gain_db[i] / 20.0) : 1.0;
            assert_true(worst_error(&b, i, 0.008 + 4e-4 * (double)i, gain) < 2e-3 * gain);
        }
        bench_close(&b);
    }
}

static void a_deaf_microphone_is_amplified_by_20_db_at_most(void **state)
{
    double f_hz[] = {1000.0}, deaf_db[] = {-60.0}, loud_db[] = {60.0};
    struct microphone deaf = {1, f_hz, deaf_db}, loud = {1, f_hz, loud_db};
    const struct microphone *microphones[] = {&deaf, &loud};
    struct pulse_compress_config cfg = standard;
    struct bench b;

    (void)state;
    cfg.n_channels = 2;
    cfg.microphones = microphones;
    bench_open(&b, &cfg);
    echo_add(&cosine, b.x, N_PING, 0.010, 1.0);
    echo_add(&cosine, b.x + N_PING, N_PING, 0.010, 1.0);
    bench_run(&b);
    assert_true(worst_error(&b, 0, 0.010, 10.0) < 2e-2);
    assert_true(worst_error(&b, 1, 0.010, 0.1) < 2e-4);
    bench_close(&b);
}

static void a_replica_of_ones_own_does_what_the_chirp_does(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench a, b;
    float replica[N_REPLICA] = {0};

    (void)state;
    echo_add(&cosine, replica, N_REPLICA, 0.0, 1.0);
    bench_open(&a, &cfg);
    cfg.band_hz[0] = 2000.0;
    cfg.band_hz[1] = 20000.0;
    cfg.n_replica = N_REPLICA;
    cfg.replica = replica;
    bench_open(&b, &cfg);
    echo_add(&cosine, a.x, N_PING, 0.013, 1.0);
    memcpy(b.x, a.x, N_PING * sizeof(*b.x));
    bench_run(&a);
    bench_run(&b);
    for (size_t n = 0; n < a.f.n_samples; n++)
        assert_true(cabsf(a.y[n] - b.y[n]) < 1e-5f);
    bench_close(&a);
    bench_close(&b);
}

/* The last slot of a recording has no tail: an echo loses its end, not its place. */
static void a_ping_without_a_tail_still_shows_its_echoes(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct bench b;
    double tau = 600.0 / RATE_HZ;

    (void)state;
    cfg.n_samples = N_REPLICA;
    cfg.oversampling = 8.0;
    bench_open(&b, &cfg);
    echo_add(&cosine, b.x, N_REPLICA, tau, 1.0);
    bench_run(&b);
    /* The last fifth of the band is missing: 1 - 0.2 + sin(0.4 pi) / (2 pi) = 0.951. */
    assert_true(fabs(largest(&b) - 0.951) < 0.02);
    bench_close(&b);
}

static void a_gate_beyond_the_ping_is_refused(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct pulse_compress *pc = NULL;

    (void)state;
    cfg.gate_s[1] = 4201.0 / RATE_HZ;
    assert_int_equal(pulse_compress_create(&pc, &cfg), -ERANGE);
    cfg = standard;
    cfg.latency_samples = 3100.0;
    assert_int_equal(pulse_compress_create(&pc, &cfg), -ERANGE);
    assert_null(pc);
}

static void nonsense_is_refused(void **state)
{
    struct pulse_compress *pc = NULL;
    float silence[100] = {0};

#define REFUSED(field, value)                                                            \
    do {                                                                                 \
        struct pulse_compress_config cfg = standard;                                     \
        cfg.field = (value);                                                             \
        assert_int_equal(pulse_compress_create(&pc, &cfg), -EINVAL);                     \
        assert_null(pc);                                                                 \
    } while (0)
    (void)state;
    REFUSED(sample_rate_hz, 0.0);
    REFUSED(sample_rate_hz, NAN);
    REFUSED(sample_rate_hz, 30000.0); /* 20 kHz is beyond its half */
    REFUSED(n_samples, 0);
    REFUSED(n_samples, 2999);
    REFUSED(n_channels, 0);
    REFUSED(chirp.duration_s, 0.0);
    REFUSED(chirp.duration_s, NAN);
    REFUSED(chirp.stop_hz, 24001.0);
    REFUSED(latency_samples, -1.0);
    REFUSED(latency_samples, NAN);
    REFUSED(oversampling, 0.9);
    REFUSED(oversampling, NAN);
    REFUSED(gate_s[0], -0.001);
    REFUSED(gate_s[1], 0.005);
    REFUSED(gate_s[1], NAN);
    REFUSED(band_hz[1], 30000.0);
    REFUSED(n_replica, 10);
#undef REFUSED
    struct pulse_compress_config cfg = standard;
    cfg.n_replica = 100;
    cfg.replica = silence;
    assert_int_equal(pulse_compress_create(&pc, &cfg), -EINVAL);
    assert_int_equal(pulse_compress_create(NULL, &standard), -EINVAL);
    assert_int_equal(pulse_compress_create(&pc, NULL), -EINVAL);
    pulse_compress_destroy(NULL);
}

static void a_chirp_may_take_all_that_the_rate_has(void **state)
{
    struct pulse_compress_config cfg = standard;
    struct pulse_compress *pc = NULL;

    (void)state;
    for (int down = 0; down < 2; down++) {
        cfg.chirp.start_hz = down ? 0.5 * RATE_HZ : 0.0;
        cfg.chirp.stop_hz = down ? 0.0 : 0.5 * RATE_HZ;
        assert_int_equal(pulse_compress_create(&pc, &cfg), 0);
        pulse_compress_destroy(pc);
    }
}

static void finite_input_never_becomes_nan(void **state)
{
    static const float levels[] = {0.0f, 1e-44f, 1.0f, 1e30f};
    struct pulse_compress_config cfg = standard;
    struct bench b;
    unsigned seed = 9;

    (void)state;
    cfg.n_channels = 3;
    bench_open(&b, &cfg);
    for (size_t l = 0; l < 4; l++) {
        for (size_t i = 0; i < 3 * N_PING; i++)
            b.x[i] = noise(&seed) > 0.0f ? levels[l] : -levels[l];
        bench_run(&b);
        for (size_t n = 0; n < 3 * b.f.n_samples; n++)
            assert_true(isfinite(crealf(b.y[n])) && isfinite(cimagf(b.y[n])));
        if (levels[l] == 0.0f)
            assert_near(largest(&b), 0.0, 0.0);
    }
    bench_close(&b);
}

static void the_same_ping_gives_the_same_bits(void **state)
{
    struct bench a, b;
    unsigned seed = 11;

    (void)state;
    bench_open(&a, &standard);
    bench_open(&b, &standard);
    for (size_t i = 0; i < N_PING; i++)
        a.x[i] = b.x[i] = noise(&seed);
    bench_run(&b);
    memset(b.x, 0, N_PING * sizeof(*b.x));
    bench_run(&b); /* leaves nothing behind */
    memcpy(b.x, a.x, N_PING * sizeof(*b.x));
    bench_run(&a);
    bench_run(&b);
    assert_memory_equal(a.y, b.y, a.f.n_samples * sizeof(*a.y));
    bench_close(&a);
    bench_close(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_format_covers_the_gate_just_above_the_band),
        cmocka_unit_test(a_reach_adds_to_the_gate_and_leaves_it_as_it_is),
        cmocka_unit_test(an_echo_is_the_windows_transform_at_its_delay),
        cmocka_unit_test(an_echo_peaks_at_its_delay_to_a_fiftieth_of_a_sample),
        cmocka_unit_test(a_sine_chirp_gives_the_same_pulse),
        cmocka_unit_test(latency_is_taken_out_fractions_too),
        cmocka_unit_test(compression_is_linear),
        cmocka_unit_test(a_later_signal_is_a_later_trace),
        cmocka_unit_test(noise_is_suppressed_by_the_chirps_energy),
        cmocka_unit_test(the_direct_path_stays_out_of_the_gate),
        cmocka_unit_test(the_next_emission_stays_58_db_down),
        cmocka_unit_test(a_next_emission_that_is_heard_whole_stays_100_db_down),
        cmocka_unit_test(sidelobes_are_those_of_the_window),
        cmocka_unit_test(a_rectangular_window_is_narrower_and_still_one),
        cmocka_unit_test(channels_are_independent),
        cmocka_unit_test(microphones_are_equalised),
        cmocka_unit_test(any_number_of_channels_is_any_channels_own),
        cmocka_unit_test(a_deaf_microphone_is_amplified_by_20_db_at_most),
        cmocka_unit_test(a_replica_of_ones_own_does_what_the_chirp_does),
        cmocka_unit_test(a_ping_without_a_tail_still_shows_its_echoes),
        cmocka_unit_test(a_gate_beyond_the_ping_is_refused),
        cmocka_unit_test(nonsense_is_refused),
        cmocka_unit_test(a_chirp_may_take_all_that_the_rate_has),
        cmocka_unit_test(finite_input_never_becomes_nan),
        cmocka_unit_test(the_same_ping_gives_the_same_bits),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
