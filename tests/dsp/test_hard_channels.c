/* SPDX-License-Identifier: MIT */
/* Pings as bad as they come, through both ways of compression: channels that are silent,
 * hold what is no number, clip, are denormal, or a million million times too loud. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/deramp.h"
#include "dsp/pulse_compress.h"
#include "tests/dsp/echo.h"
#include "tests/worse.h"

#define N_PING     4200
#define N_CHANNELS 3
#define DELAY_S    0.0137

static const struct sweep sweep = {48000.0, 2000.0, 20000.0, 0.0625, 0.0};

struct bench {
    struct pulse_compress *pc; /* one of the two */
    struct deramp *deramp;
    struct trace_format f;
    float x[N_CHANNELS * N_PING];
    float complex *y; /* [N_CHANNELS][f.n_samples] */
};

static struct bench *bench_open(bool deramped)
{
    struct bench *b = calloc(1, sizeof *b);
    const struct chirp chirp = {sweep.f0_hz, sweep.f1_hz, sweep.duration_s, false};
    const struct pulse_compress_config compress = {.sample_rate_hz = sweep.rate_hz,
                                                   .n_samples = N_PING,
                                                   .chirp = chirp,
                                                   .window = WINDOW_HANN,
                                                   .gate_s = {0.006, 0.025},
                                                   .oversampling = 2.0,
                                                   .n_channels = N_CHANNELS};
    const struct deramp_config deramp = {.sample_rate_hz = sweep.rate_hz,
                                         .n_samples = N_PING,
                                         .chirp = chirp,
                                         .window = WINDOW_HANN,
                                         .gate_s = {0.006, 0.025},
                                         .n_channels = N_CHANNELS,
                                         .rate_hz = 144000.0};
    assert_non_null(b);
    if (deramped) {
        assert_int_equal(deramp_create(&b->deramp, &deramp), 0);
        deramp_format(b->deramp, &b->f);
    } else {
        assert_int_equal(pulse_compress_create(&b->pc, &compress), 0);
        pulse_compress_format(b->pc, &b->f);
    }
    b->y = calloc(N_CHANNELS * b->f.n_samples, sizeof *b->y);
    assert_non_null(b->y);
    for (size_t i = 0; i < N_CHANNELS; i++)
        echo_add(&sweep, b->x + i * N_PING, N_PING, DELAY_S, 1.0);
    return b;
}

static void bench_run(struct bench *b)
{
    if (b->pc)
        pulse_compress_execute(b->pc, b->x, N_PING, b->y);
    else
        deramp_execute(b->deramp, b->x, N_PING, b->y);
}

static void bench_close(struct bench *b)
{
    pulse_compress_destroy(b->pc);
    deramp_destroy(b->deramp);
    free(b->y);
    free(b);
}

static float complex *run_and_keep(struct bench *b)
{
    float complex *kept = malloc(N_CHANNELS * b->f.n_samples * sizeof *kept);
    assert_non_null(kept);
    bench_run(b);
    memcpy(kept, b->y, N_CHANNELS * b->f.n_samples * sizeof *kept);
    return kept;
}

/* The others come out to the last bit as if it were healthy, and so does the next ping.
 */
static void what_is_no_number_stays_in_its_channel_and_its_ping(void **state)
{
    (void)state;
    static const float bad[3] = {NAN, INFINITY, -INFINITY};
    for (int q = 0; q < 6; q++) {
        struct bench *b = bench_open(q % 2);
        size_t n = b->f.n_samples;
        float complex *healthy = run_and_keep(b);
        float kept = b->x[N_PING + 1500];
        b->x[N_PING + 1500] = bad[q / 2];
        bench_run(b);
        assert_false(isfinite(crealf(b->y[n + n / 2])));
        assert_memory_equal(b->y, healthy, n * sizeof *healthy);
        assert_memory_equal(b->y + 2 * n, healthy + 2 * n, n * sizeof *healthy);
        b->x[N_PING + 1500] = kept;
        bench_run(b);
        assert_memory_equal(b->y, healthy, N_CHANNELS * n * sizeof *healthy);
        free(healthy);
        bench_close(b);
    }
}

static void silence_stays_silent_beside_sound(void **state)
{
    (void)state;
    for (int q = 0; q < 2; q++) {
        struct bench *b = bench_open(q);
        memset(b->x + N_PING, 0, N_PING * sizeof *b->x);
        bench_run(b);
        for (size_t n = 0; n < b->f.n_samples; n++)
            assert_true(b->y[b->f.n_samples + n] == 0.0f);
        assert_true(cabsf(b->y[(size_t)((DELAY_S - b->f.t0_s) * b->f.rate_hz)]) > 0.5f);
        bench_close(b);
    }
}

static double largest_difference(const struct bench *b, const float complex *plain,
                                 double gain)
{
    double worst = 0.0;
    for (size_t n = 0; n < N_CHANNELS * b->f.n_samples; n++) {
        double re = fabs(crealf(b->y[n]) / gain - crealf(plain[n]));
        double im = fabs(cimagf(b->y[n]) / gain - cimagf(plain[n]));
        worst = worse(worst, re);
        worst = worse(worst, im);
    }
    return worst;
}

/* Of an echo that peaks at 1. */
static void gains_of_twelve_decades_only_scale_to_1e_6(void **state)
{
    (void)state;
    static const double gains[4] = {1e-12, 0.03, -30.0, 1e12};
    for (int q = 0; q < 8; q++) {
        struct bench *b = bench_open(q % 2);
        float complex *plain = run_and_keep(b);
        double gain = gains[q / 2];
        for (size_t i = 0; i < N_CHANNELS * N_PING; i++)
            b->x[i] *= (float)gain;
        bench_run(b);
        assert_true(largest_difference(b, plain, gain) < 1e-6);
        free(plain);
        bench_close(b);
    }
}

/* A denormal number has few digits, and their sum no more: 1% at 1e-40. */
static void denormal_numbers_keep_their_digits(void **state)
{
    (void)state;
    for (int q = 0; q < 2; q++) {
        struct bench *b = bench_open(q);
        float complex *plain = run_and_keep(b);
        for (size_t i = 0; i < N_CHANNELS * N_PING; i++)
            b->x[i] *= 1e-40f;
        bench_run(b);
        assert_true(largest_difference(b, plain, 1e-40) < 0.01);
        free(plain);
        bench_close(b);
    }
}

/* The time of the peak, between samples. */
static double peak_s(const struct bench *b, double *level)
{
    size_t best = 1;
    for (size_t n = 1; n + 1 < b->f.n_samples; n++)
        best = cabsf(b->y[n]) > cabsf(b->y[best]) ? n : best;
    double l = cabsf(b->y[best - 1]), h = cabsf(b->y[best]), r = cabsf(b->y[best + 1]);
    *level = h;
    return b->f.t0_s + ((double)best + 0.5 * (r - l) / (2.0 * h - l - r)) / b->f.rate_hz;
}

/* Clipping at a tenth makes a chirp a square wave, 4 / pi as strong at its own frequency;
 * the overtones are spread over all delays.  The echo stays within 1 us. */
static void a_clipped_echo_stays_where_it_is(void **state)
{
    (void)state;
    for (int q = 0; q < 2; q++) {
        struct bench *b = bench_open(q);
        double level;
        for (size_t i = 0; i < N_CHANNELS * N_PING; i++)
            b->x[i] = fminf(fmaxf(b->x[i], -0.1f), 0.1f);
        bench_run(b);
        assert_true(fabs(peak_s(b, &level) - DELAY_S) < 1e-6);
        assert_true(fabs(level / (0.1 * 4.0 / M_PI) - 1.0) < 0.05);
        bench_close(b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_no_number_stays_in_its_channel_and_its_ping),
        cmocka_unit_test(silence_stays_silent_beside_sound),
        cmocka_unit_test(gains_of_twelve_decades_only_scale_to_1e_6),
        cmocka_unit_test(denormal_numbers_keep_their_digits),
        cmocka_unit_test(a_clipped_echo_stays_where_it_is),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
