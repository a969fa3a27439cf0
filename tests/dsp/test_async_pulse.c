/* SPDX-License-Identifier: MIT */
/* Pulses on a floor of their own, and noise. */
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

#include "dsp/async_pulse.h"
#include "hal/random.h"

enum { CHANNELS = 8, SAMPLES = 200, GUARD = 3, MANY = 20000 };

static const bool fit[CHANNELS] = {false};
static const size_t reach[ASYNC_PULSE_PINGS] = {10, 20};

struct rig {
    struct async_pulse *a;
    float complex y[CHANNELS][SAMPLES];
    uint8_t foreign[CHANNELS][SAMPLES];
};

static int setup(void **state)
{
    const struct async_pulse_config cfg = {
        .n_channels = CHANNELS, .n_samples = SAMPLES, .guard = GUARD};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || async_pulse_create(&r->a, &cfg))
        return -1;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    async_pulse_destroy(r->a);
    free(r);
    return 0;
}

/* A floor of power 1, and in the first n channels a pulse of amplitude 10. */
static void hear(struct rig *r, size_t n, size_t at)
{
    for (size_t m = 0; m < CHANNELS; m++)
        for (size_t i = 0; i < SAMPLES; i++)
            r->y[m][i] = m < n && i == at ? 10.0f : 1.0f;
}

static bool execute(struct rig *r)
{
    return async_pulse_execute(r->a, &r->y[0][0], fit, reach, &r->foreign[0][0]);
}

static size_t count(const struct rig *r)
{
    size_t n = 0;

    for (size_t i = 0; i < CHANNELS * SAMPLES; i++)
        n += (&r->foreign[0][0])[i];
    return n;
}

/* By the reach of the ping before, from ping to ping. */
static void what_moves_no_farther_than_its_reach_is_ours(void **state)
{
    struct rig *r = *state;

    for (size_t at = 20; at < SAMPLES; at += 10) {
        hear(r, CHANNELS, at);
        assert_false(execute(r));
        assert_int_equal(count(r), 0);
    }
}

static void what_jumps_is_foreign_with_its_pulse_and_nothing_else(void **state)
{
    static const size_t at[] = {20, 60, 100, 2, 199};
    struct rig *r = *state;

    for (size_t k = 0; k < 5; k++) {
        hear(r, CHANNELS, at[k]);
        assert_true(execute(r) == (k >= 2)); /* held against two pings before */
        size_t from = at[k] > GUARD ? at[k] - GUARD : 0;
        size_t to = at[k] + GUARD < SAMPLES ? at[k] + GUARD : SAMPLES - 1;
        for (size_t m = 0; m < CHANNELS && k >= 2; m++)
            for (size_t i = 0; i < SAMPLES; i++)
                assert_int_equal(r->foreign[m][i], i >= from && i <= to);
    }
}

/* What jumps behind them is not looked at, and hides nothing that jumps before. */
static void only_the_samples_that_count_are_foreign(void **state)
{
    static const size_t at[] = {20, 60, 100, 150, 130, 118};
    const struct async_pulse_config cfg = {
        .n_channels = CHANNELS, .n_samples = SAMPLES, .until = 120, .guard = GUARD};
    struct rig *r = *state;

    async_pulse_destroy(r->a);
    assert_int_equal(async_pulse_create(&r->a, &cfg), 0);
    for (size_t k = 0; k < 6; k++) {
        hear(r, CHANNELS, at[k]);
        assert_true(execute(r) == (k == 2 || k == 5));
        for (size_t m = 0; m < CHANNELS; m++)
            for (size_t i = 0; i < SAMPLES; i++)
                assert_int_equal(r->foreign[m][i], (k == 2 || k == 5) && i < cfg.until &&
                                                       i + GUARD >= at[k] &&
                                                       i <= at[k] + GUARD);
    }
}

/* An echo of ours is in both pings before; one that was there in one of them is not. */
static void what_was_there_in_one_ping_of_the_two_is_foreign(void **state)
{
    struct rig *r = *state;

    hear(r, CHANNELS, 20);
    execute(r);
    hear(r, CHANNELS, 100);
    execute(r);
    hear(r, CHANNELS, 25);
    assert_true(execute(r));
    assert_int_equal(count(r), CHANNELS * (2 * GUARD + 1));
}

static void half_of_the_microphones_have_to_hear_it(void **state)
{
    struct rig *r = *state;

    for (size_t n = 0; n <= CHANNELS; n++) {
        async_pulse_reset(r->a);
        hear(r, 0, 0);
        execute(r);
        execute(r);
        hear(r, n, 50);
        assert_true(execute(r) == (2 * n >= CHANNELS));
        assert_int_equal(count(r), 2 * n >= CHANNELS ? n * (2 * GUARD + 1) : 0);
    }
}

static void a_microphone_that_was_masked_is_not_held_against_anything(void **state)
{
    bool masked[CHANNELS] = {false};
    struct rig *r = *state;

    for (size_t m = 2; m < CHANNELS; m++)
        masked[m] = true;
    hear(r, 0, 0);
    async_pulse_execute(r->a, &r->y[0][0], masked, reach, &r->foreign[0][0]);
    execute(r);
    hear(r, CHANNELS, 50);
    assert_true(execute(r)); /* both of two */
    assert_int_equal(count(r), 2 * (2 * GUARD + 1));
}

/* Ten times over all within reach in the less loud of two pings, by looking at each. */
static void maxima_are_of_all_within_reach_and_of_no_more(void **state)
{
    static const size_t reaches[][ASYNC_PULSE_PINGS] = {{0, 0},
                                                        {1, 2},
                                                        {7, 30},
                                                        {99, 150},
                                                        {SAMPLES - 1, SAMPLES - 1},
                                                        {SAMPLES, SIZE_MAX}};
    const struct async_pulse_config cfg = {.n_channels = 1, .n_samples = SAMPLES};
    float complex y[3][SAMPLES];
    uint8_t foreign[SAMPLES];
    struct random random;
    struct async_pulse *a;

    (void)state;
    random_seed(&random, (uint64_t[]){3}, 1);
    assert_int_equal(async_pulse_create(&a, &cfg), 0);
    for (size_t c = 0; c < sizeof reaches / sizeof *reaches; c++) {
        bool hit = false, any = false;
        async_pulse_reset(a);
        for (size_t k = 0; k < 3; k++) {
            for (size_t i = 0; i < SAMPLES; i++)
                y[k][i] = (float)exp(2.0 * random_normal(&random));
            hit = async_pulse_execute(a, y[k], fit, reaches[c], foreign);
        }
        for (int pass = 0; pass < 2; pass++)
            for (size_t i = 0; i < SAMPLES; i++) {
                float most[2] = {0.0f, 0.0f}, now = crealf(y[2][i]) * crealf(y[2][i]);
                for (size_t k = 0; k < 2; k++)
                    for (size_t j = 0; j < SAMPLES; j++)
                        if ((j > i ? j - i : i - j) <= reaches[c][k])
                            most[k] =
                                fmaxf(most[k], crealf(y[1 - k][j]) * crealf(y[1 - k][j]));
                float least = fminf(most[0], most[1]);
                if (pass == 0)
                    any |= now > (float)ASYNC_PULSE_RATIO * least;
                else
                    assert_int_equal(foreign[i],
                                     any && now > (float)ASYNC_PULSE_REST * least);
            }
        assert_true(hit == any);
    }
    async_pulse_destroy(a);
}

/* Of three exponential powers one is r times over the less loud of the others with
 * probability 2 / (2 + r): the less loud of two has half the mean, and E[exp(-r m)] is 1
 * / (1 + r / 2).  Half of the samples for r = 2, within five standard deviations. */
static void in_noise_it_is_as_rare_as_ordered_statistics_say(void **state)
{
    const struct async_pulse_config cfg = {.n_channels = 1, .n_samples = MANY};
    static const size_t none[ASYNC_PULSE_PINGS] = {0, 0};
    float complex *y = malloc(MANY * sizeof *y);
    uint8_t *foreign = malloc(MANY);
    struct random random;
    struct async_pulse *a;
    size_t n = 0;

    (void)state;
    assert_non_null(y);
    assert_non_null(foreign);
    random_seed(&random, (uint64_t[]){4}, 1);
    assert_int_equal(async_pulse_create(&a, &cfg), 0);
    for (int k = 0; k < 3; k++) {
        for (size_t i = 0; i < MANY; i++) {
            float re = (float)random_normal(&random);
            y[i] = re + (float)random_normal(&random) * I;
        }
        assert_true(async_pulse_execute(a, y, fit, none, foreign) == (k == 2));
    }
    for (size_t i = 0; i < MANY; i++)
        n += foreign[i];
    double expected = 2.0 / (2.0 + ASYNC_PULSE_REST);
    double sigma = sqrt(expected * (1.0 - expected) / MANY);
    assert_true(fabs((double)n / MANY - expected) < 5.0 * sigma);
    async_pulse_destroy(a);
    free(y);
    free(foreign);
}

static void nothing_to_hold_against_each_other_is_refused(void **state)
{
    struct async_pulse *a;

    (void)state;
    assert_int_equal(async_pulse_create(&a, &(struct async_pulse_config){.n_samples = 1}),
                     -EINVAL);
    assert_int_equal(
        async_pulse_create(&a, &(struct async_pulse_config){.n_channels = 1}), -EINVAL);
    const struct async_pulse_config long_ones = {
        .n_channels = 1, .n_samples = 1, .until = 2};
    assert_int_equal(async_pulse_create(&a, &long_ones), -EINVAL);
    assert_null(a);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_moves_no_farther_than_its_reach_is_ours),
        TEST(what_jumps_is_foreign_with_its_pulse_and_nothing_else),
        TEST(only_the_samples_that_count_are_foreign),
        TEST(what_was_there_in_one_ping_of_the_two_is_foreign),
        TEST(half_of_the_microphones_have_to_hear_it),
        TEST(a_microphone_that_was_masked_is_not_held_against_anything),
        cmocka_unit_test(maxima_are_of_all_within_reach_and_of_no_more),
        cmocka_unit_test(in_noise_it_is_as_rare_as_ordered_statistics_say),
        cmocka_unit_test(nothing_to_hold_against_each_other_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
