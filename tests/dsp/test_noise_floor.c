/* SPDX-License-Identifier: MIT */
/* Noise of a known power under echoes that are the same each time. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/noise_floor.h"
#include "hal/random.h"
#include "tests/dsp/near.h"

enum { SPEAKERS = 2, CHANNELS = 2, SAMPLES = 1500, FROM = 100, UNTIL = 1400 };

static const struct noise_floor_config cfg = {.n_speakers = SPEAKERS,
                                              .n_channels = CHANNELS,
                                              .n_samples = SAMPLES,
                                              .from = FROM,
                                              .until = UNTIL};

/* Mean power of a sample: channel 0 has `power`, channel 1 four times that.  Echoes are
 * 40 dB over it, and other ones for each speaker. */
static void make(float complex y[CHANNELS][SAMPLES], size_t speaker, double power,
                 struct random *r)
{
    for (size_t m = 0; m < CHANNELS; m++) {
        double sigma = sqrt(power * (m ? 4.0 : 1.0) / 2.0);
        for (size_t i = 0; i < SAMPLES; i++) {
            double echo = 100.0 * sin((double)(i * (speaker + 3)));
            y[m][i] = (float)(echo + sigma * random_normal(r)) +
                      (float)(sigma * random_normal(r)) * I;
        }
    }
}

static void the_power_of_what_is_new_is_found_under_echoes(void **state)
{
    static float complex y[CHANNELS][SAMPLES];
    double power[CHANNELS] = {-1.0, -1.0};
    struct noise_floor *f;
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){1}, 1);
    assert_int_equal(noise_floor_create(&f, &cfg), 0);
    for (size_t j = 0; j < SPEAKERS; j++) {
        make(y, j, 0.5, &r);
        assert_false(noise_floor_execute(f, j, &y[0][0], NULL, power));
        assert_true(power[0] < 0.0);
    }
    for (size_t k = 0; k < 10; k++) {
        make(y, k % 2, 0.5, &r);
        assert_true(noise_floor_execute(f, k % 2, &y[0][0], NULL, power));
        /* A median of 1300 exponential powers: 1 / (sqrt(1300) ln 2) of it, 4 %. */
        assert_near(power[0], 0.5, 0.08);
        assert_near(power[1], 2.0, 0.32);
    }
    noise_floor_destroy(f);
}

/* 60 of 1300 samples: the median is at the 47.6th instead of the 50th hundredth. */
static void what_moves_by_hardly_counts(void **state)
{
    static float complex y[CHANNELS][SAMPLES];
    double power[CHANNELS];
    struct noise_floor *f;
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){2}, 1);
    assert_int_equal(noise_floor_create(&f, &cfg), 0);
    make(y, 0, 0.5, &r);
    noise_floor_execute(f, 0, &y[0][0], NULL, power);
    make(y, 0, 0.5, &r);
    for (size_t i = 500; i < 560; i++)
        y[0][i] += 1000.0f;
    noise_floor_execute(f, 0, &y[0][0], NULL, power);
    assert_near(power[0], 0.5, 0.1);
    noise_floor_destroy(f);
}

/* Three tenths of the samples have echoes, other ones in each ping: in the difference
 * more than half.  A tenth of all is a seventh of the rest: -ln(6/7) / -ln(9/10) is 1.46.
 */
static void echoes_that_are_new_in_each_ping_hardly_count(void **state)
{
    static float complex y[CHANNELS][SAMPLES];
    double power[CHANNELS], sum = 0.0;
    struct noise_floor *f;
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){5}, 1);
    assert_int_equal(noise_floor_create(&f, &cfg), 0);
    for (int k = 0; k < 21; k++) {
        for (size_t m = 0; m < CHANNELS; m++)
            for (size_t i = 0; i < SAMPLES; i++) {
                y[m][i] = (float)(sqrt(0.5) * random_normal(&r)) +
                          (float)(sqrt(0.5) * random_normal(&r)) * I;
                if (random_even(&r) < 0.3)
                    y[m][i] += (float)(100.0 * random_normal(&r));
            }
        noise_floor_execute(f, 0, &y[0][0], NULL, power);
        sum += k ? power[0] / 20.0 : 0.0;
    }
    assert_near(sum, 1.46, 0.15);
    noise_floor_destroy(f);
}

/* 25 dB more is there with the first ping that has it. */
static void noise_that_rises_is_seen_at_once(void **state)
{
    static float complex y[CHANNELS][SAMPLES];
    double power[CHANNELS];
    struct noise_floor *f;
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){3}, 1);
    assert_int_equal(noise_floor_create(&f, &cfg), 0);
    make(y, 0, 1.0, &r);
    noise_floor_execute(f, 0, &y[0][0], NULL, power);
    make(y, 0, pow(10.0, 2.5), &r);
    noise_floor_execute(f, 0, &y[0][0], NULL, power);
    /* The difference has half of the new noise in it, and half of the old. */
    assert_near(10.0 * log10(power[0]), 25.0 - 10.0 * log10(2.0), 0.7);
    make(y, 0, pow(10.0, 2.5), &r);
    noise_floor_execute(f, 0, &y[0][0], NULL, power);
    assert_near(10.0 * log10(power[0]), 25.0, 0.7);
    noise_floor_destroy(f);
}

/* A broken microphone's samples come as 0: neither it nor what follows is taken for
 * noise, and what the others hear counts. */
static void samples_that_are_none_are_not_taken_for_noise(void **state)
{
    static float complex y[CHANNELS][SAMPLES];
    static const bool unfit[CHANNELS] = {false, true};
    double power[CHANNELS] = {-1.0, -1.0};
    struct noise_floor *f;
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){6}, 1);
    assert_int_equal(noise_floor_create(&f, &cfg), 0);
    make(y, 0, 0.5, &r);
    assert_false(noise_floor_execute(f, 0, &y[0][0], unfit, power));
    make(y, 0, 0.5, &r);
    assert_true(noise_floor_execute(f, 0, &y[0][0], NULL, power));
    assert_near(power[0], 0.5, 0.08);
    assert_true(isnan(power[1])); /* heard for the first time */
    for (int k = 0; k < 4; k++) {
        make(y, 0, 0.5, &r);
        for (size_t i = 0; i < SAMPLES && k % 2; i++)
            y[1][i] = 0.0f;
        assert_true(noise_floor_execute(f, 0, &y[0][0], k % 2 ? unfit : NULL, power));
        assert_near(power[0], 0.5, 0.08);
        assert_true(k % 2 ? isnan(power[1]) : fabs(power[1] - 2.0) < 0.32);
    }
    noise_floor_destroy(f);
}

static void a_window_that_is_none_is_refused(void **state)
{
    struct noise_floor_config bad = cfg;
    struct noise_floor *f;

    (void)state;
    bad.until = FROM;
    assert_int_not_equal(noise_floor_create(&f, &bad), 0);
    bad.until = SAMPLES + 1;
    assert_int_not_equal(noise_floor_create(&f, &bad), 0);
    noise_floor_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_power_of_what_is_new_is_found_under_echoes),
        cmocka_unit_test(what_moves_by_hardly_counts),
        cmocka_unit_test(echoes_that_are_new_in_each_ping_hardly_count),
        cmocka_unit_test(noise_that_rises_is_seen_at_once),
        cmocka_unit_test(samples_that_are_none_are_not_taken_for_noise),
        cmocka_unit_test(a_window_that_is_none_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
