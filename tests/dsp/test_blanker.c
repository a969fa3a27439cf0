/* SPDX-License-Identifier: MIT */
/* Traces of noise and echoes, and recordings of chirps with a slam in them. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "dsp/blanker.h"
#include "dsp/pulse_compress.h"
#include "hal/random.h"
#include "tests/dsp/echo.h"

#define SLOT_NS INT64_C(24000000)

enum { CHANNELS = 8, SAMPLES = 300, FROM = 20 };

static const bool fit[CHANNELS] = {false};

struct rig {
    struct blanker *blanker;
    struct random random;
    float complex y[CHANNELS][SAMPLES], background[CHANNELS][SAMPLES];
    int64_t now_ns;
};

static int setup(void **state)
{
    const struct blanker_config cfg = {.n_channels = CHANNELS,
                                       .n_samples = SAMPLES,
                                       .from = FROM,
                                       .until = SAMPLES,
                                       .longest_ns = 20 * SLOT_NS};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || blanker_create(&r->blanker, &cfg))
        return -1;
    random_seed(&r->random, (uint64_t[]){7}, 1);
    for (size_t i = 0; i < CHANNELS * SAMPLES; i++)
        (&r->background[0][0])[i] = 30.0f * (float)sin((double)(i * i)) +
                                    30.0f * (float)cos((double)(i * i)) * I;
    r->now_ns = 1;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    blanker_destroy(r->blanker);
    free(r);
    return 0;
}

/* A ping with so much noise over the usual in the first n channels. */
static bool ping(struct rig *r, double noise_db, size_t n)
{
    for (size_t m = 0; m < CHANNELS; m++)
        for (size_t i = 0; i < SAMPLES; i++) {
            float sigma = m < n ? (float)pow(10.0, 0.05 * noise_db) : 1.0f;
            float re = sigma * (float)random_normal(&r->random);
            float im = sigma * (float)random_normal(&r->random);
            r->y[m][i] = r->background[m][i] + re + im * I;
        }
    return blanker_execute(r->blanker, &r->y[0][0], &r->background[0][0], fit,
                           r->now_ns += SLOT_NS);
}

/* A quarter of the channels is off by 6 dB, 33 standard deviations, in none of any
 * number. */
static void in_noise_alone_no_ping_is_blanked(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 500; k++)
        assert_false(ping(r, 0.0, CHANNELS));
}

static void a_burst_in_all_channels_is_blanked_and_the_ping_after_it(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 4; k++)
        assert_false(ping(r, 0.0, CHANNELS));
    for (int k = 0; k < 5; k++)
        assert_true(ping(r, 10.0, CHANNELS));
    assert_true(ping(r, 0.0, CHANNELS));
    for (int k = 0; k < 4; k++)
        assert_false(ping(r, 0.0, CHANNELS));
}

/* One microphone in the rain is not the array. */
static void a_burst_in_half_of_the_channels_is_not(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 4; k++)
        assert_false(ping(r, 0.0, CHANNELS));
    assert_false(ping(r, 20.0, CHANNELS / 2));
    assert_false(ping(r, 0.0, CHANNELS));
}

/* 4 dB more with each ping: a gust, or a car that comes nearer. */
static void what_becomes_louder_slowly_is_not(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 12; k++)
        assert_false(ping(r, 4.0 * k, CHANNELS));
    for (int k = 0; k < 300; k++)
        assert_false(ping(r, 0.0, CHANNELS));
    assert_true(ping(r, 20.0, CHANNELS)); /* what faded is forgotten */
}

/* They fill most of the traces, and are 12 dB louder in every second ping. */
static void echoes_that_change_are_not_when_no_background_is_known(void **state)
{
    struct rig *r = *state;

    for (int k = 0; k < 20; k++) {
        for (size_t m = 0; m < CHANNELS; m++)
            for (size_t i = 0; i < SAMPLES; i++) {
                float sigma = i % 5 < 3 ? (k % 2 ? 40.0f : 10.0f) : 1.0f;
                float re = sigma * (float)random_normal(&r->random);
                float im = sigma * (float)random_normal(&r->random);
                r->y[m][i] = re + im * I;
            }
        assert_false(
            blanker_execute(r->blanker, &r->y[0][0], NULL, fit, r->now_ns += SLOT_NS));
    }
}

static void what_stays_is_the_noise_of_the_place(void **state)
{
    struct rig *r = *state;
    int blanked = 0;

    for (int k = 0; k < 4; k++)
        assert_false(ping(r, 0.0, CHANNELS));
    while (ping(r, 20.0, CHANNELS))
        blanked++;
    assert_int_equal(blanked, 21); /* 0 to 20 slots after the first */
    for (int k = 0; k < 10; k++)
        assert_false(ping(r, 20.0, CHANNELS));
}

/* Rounding is 100 dB under the echoes; something comes whose sidelobes are 80 dB under
 * them. */
static void without_noise_an_echo_is_no_burst(void **state)
{
    struct rig *r = *state;

    memcpy(r->y, r->background, sizeof r->y);
    for (int k = 0; k < 4; k++) {
        r->y[k][k] += 3e-4f;
        assert_false(blanker_execute(r->blanker, &r->y[0][0], &r->background[0][0], fit,
                                     r->now_ns += SLOT_NS));
    }
    for (size_t i = 0; i < CHANNELS * SAMPLES; i++)
        (&r->y[0][0])[i] += 3e-3f;
    assert_false(blanker_execute(r->blanker, &r->y[0][0], &r->background[0][0], fit,
                                 r->now_ns += SLOT_NS));
}

/* -- recordings -------------------------------------------------------------------------
 */

enum { RECORDED = 2304, MICROPHONES = 4 };

static const struct sweep sweep = {48000.0, 2000.0, 20000.0, 0.02, 0.0};

/* Direct sound, a wall's echo 27 dB and a person's 6 dB over white noise of rms 1; a slam
 * of so much more, which decays within 25 ms. */
static bool record(struct blanker *b, struct pulse_compress *pc, struct random *random,
                   double slam_db, int64_t now_ns)
{
    static float x[MICROPHONES][RECORDED];
    static float complex y[MICROPHONES * RECORDED];

    for (size_t m = 0; m < MICROPHONES; m++) {
        memset(x[m], 0, sizeof x[m]);
        echo_add(&sweep, x[m], RECORDED, 1e-3 + 1e-4 * (double)m, 100.0);
        echo_add(&sweep, x[m], RECORDED, 13e-3 + 1e-4 * (double)m, 32.0);
        echo_add(&sweep, x[m], RECORDED, 18e-3 + 1e-4 * (double)m, 2.8);
        for (size_t i = 0; i < RECORDED; i++) {
            double slam = pow(10.0, 0.05 * slam_db) * exp(-(double)i / 1200.0);
            x[m][i] += (float)((1.0 + slam) * random_normal(random));
        }
    }
    pulse_compress_execute(pc, &x[0][0], RECORDED, y);
    return blanker_execute(b, y, NULL, fit, now_ns);
}

/* Without a background, between the echoes. */
static void a_slam_in_a_recording_of_a_chirp_is_blanked(void **state)
{
    const struct pulse_compress_config compress = {
        .sample_rate_hz = 48000.0,
        .n_samples = RECORDED,
        .chirp = {2000.0, 20000.0, 0.02, false},
        .window = WINDOW_HANN,
        .gate_s = {9e-3, 24e-3},
        .oversampling = 2.0,
        .n_channels = MICROPHONES};
    struct blanker_config cfg = {.n_channels = MICROPHONES, .longest_ns = 20 * SLOT_NS};
    struct pulse_compress *pc;
    struct trace_format format;
    struct blanker *b;
    struct random random;
    int64_t now_ns = 0;

    (void)state;
    random_seed(&random, (uint64_t[]){3}, 1);
    assert_int_equal(pulse_compress_create(&pc, &compress), 0);
    pulse_compress_format(pc, &format);
    cfg.n_samples = cfg.until = format.n_samples;
    cfg.from = (size_t)ceil((9e-3 - format.t0_s) * format.rate_hz);
    assert_int_equal(blanker_create(&b, &cfg), 0);
    for (int k = 0; k < 20; k++)
        assert_false(record(b, pc, &random, -300.0, now_ns += SLOT_NS));
    assert_true(record(b, pc, &random, 40.0, now_ns += SLOT_NS));
    assert_true(record(b, pc, &random, 32.0, now_ns += SLOT_NS));
    assert_true(record(b, pc, &random, -300.0, now_ns += SLOT_NS));
    assert_false(record(b, pc, &random, -300.0, now_ns += SLOT_NS));
    blanker_destroy(b);
    pulse_compress_destroy(pc);
}

static void what_cannot_be_judged_is_refused(void **state)
{
    struct blanker *b;
    struct blanker_config cfg = {.n_channels = 1, .n_samples = 4, .until = 5};

    (void)state;
    assert_int_equal(blanker_create(&b, &cfg), -EINVAL);
    cfg = (struct blanker_config){.n_channels = 1, .n_samples = 4};
    assert_int_equal(blanker_create(&b, &cfg), -EINVAL);
    cfg = (struct blanker_config){.n_samples = 4, .until = 4};
    assert_int_equal(blanker_create(&b, &cfg), -EINVAL);
    blanker_destroy(NULL);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(in_noise_alone_no_ping_is_blanked),
        TEST(a_burst_in_all_channels_is_blanked_and_the_ping_after_it),
        TEST(a_burst_in_half_of_the_channels_is_not),
        TEST(what_becomes_louder_slowly_is_not),
        TEST(echoes_that_change_are_not_when_no_background_is_known),
        TEST(what_stays_is_the_noise_of_the_place),
        TEST(without_noise_an_echo_is_no_burst),
        cmocka_unit_test(a_slam_in_a_recording_of_a_chirp_is_blanked),
        cmocka_unit_test(what_cannot_be_judged_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
