/* SPDX-License-Identifier: MIT */
/* Noise, and echoes in it, as they are heard in many traces or in few. */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/stationary.h"
#include "hal/random.h"

enum { SAMPLES = 2048 };

/* White, of one power. */
static void add_noise(float complex x[SAMPLES], double sigma, struct random *r)
{
    for (size_t i = 0; i < SAMPLES; i++)
        x[i] = (float)(sigma * random_normal(r)) + (float)(sigma * random_normal(r)) * I;
}

/* About a quarter to a half of the rate, in the middle of the third eighth. */
static void add_echo(float complex x[SAMPLES], double gain)
{
    for (size_t i = 0; i < 120; i++) {
        double t = (double)i, phase = 2.0 * M_PI * (0.25 * t + 0.25 * t * t / 240.0);
        double rise = sin(M_PI * (t + 0.5) / 120.0);
        x[580 + i] += (float)(gain * rise * rise * cos(phase)) +
                      (float)(gain * rise * rise * sin(phase)) * I;
    }
}

static size_t count(const enum stationary_kind *kind, enum stationary_kind which,
                    size_t from, size_t to)
{
    size_t n = 0;

    for (size_t q = from; q < to; q++)
        n += kind[q] == which;
    return n;
}

static void many_traces_tell_echoes_from_noise(void **state)
{
    enum stationary_kind kind[STATIONARY_PARTS];
    float complex x[SAMPLES];
    struct stationary *s;
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){1}, 1);
    assert_int_equal(stationary_create(&s, SAMPLES, false), 0);
    size_t n = stationary_parts(s);
    assert_int_equal(n, STATIONARY_PARTS);
    for (int k = 0; k < 300; k++) {
        add_noise(x, 1.0, &r);
        add_echo(x, 40.0);
        stationary_take(s, x, 1);
    }
    stationary_judge(s, kind);
    assert_int_equal(count(kind, STATIONARY_ECHOES, 42, 54), 12);
    assert_int_equal(count(kind, STATIONARY_NOISE, 0, 24), 24);
    assert_int_equal(count(kind, STATIONARY_NOISE, 72, n), n - 72);
    stationary_destroy(s);
}

/* One of four is 20 dB louder than the others. */
static void traces_of_unlike_strength_are_told_apart_too(void **state)
{
    enum stationary_kind kind[STATIONARY_PARTS];
    float complex x[SAMPLES];
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){2}, 1);
    for (int echoes = 0; echoes < 2; echoes++) {
        struct stationary *s;
        assert_int_equal(stationary_create(&s, SAMPLES, false), 0);
        for (int k = 0; k < 40; k++) {
            add_noise(x, !echoes && k % 4 ? 0.1 : 1.0, &r);
            add_echo(x, echoes ? k % 4 ? 40.0 : 400.0 : 0.0);
            stationary_take(s, x, 1);
        }
        stationary_judge(s, kind);
        if (echoes)
            assert_int_equal(count(kind, STATIONARY_ECHOES, 42, 54), 12);
        else
            assert_int_equal(count(kind, STATIONARY_NOISE, 0, STATIONARY_PARTS),
                             STATIONARY_PARTS);
        stationary_destroy(s);
    }
}

/* Alike as they are: that they are is chance. */
static void few_traces_of_an_echo_are_not_sure(void **state)
{
    enum stationary_kind kind[STATIONARY_PARTS];
    float complex x[SAMPLES];
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){4}, 1);
    for (int n = 1; n <= 8; n++) {
        struct stationary *s;
        assert_int_equal(stationary_create(&s, SAMPLES, false), 0);
        for (int k = 0; k < n; k++) {
            add_noise(x, 1.0, &r);
            add_echo(x, 400.0);
            stationary_take(s, x, 1);
        }
        stationary_judge(s, kind);
        for (size_t q = 42; q < 54; q++)
            assert_int_equal(kind[q], n < 8 ? STATIONARY_UNCLEAR : STATIONARY_ECHOES);
        stationary_destroy(s);
    }
}

/* Samples from one to the next are `step` apart, and of real ones half the spectrum is
 * looked at. */
static void real_traces_with_others_between_are_judged_alike(void **state)
{
    enum stationary_kind apart[STATIONARY_PARTS], together[STATIONARY_PARTS];
    static float complex x[SAMPLES], wide[3 * SAMPLES];
    struct stationary *a, *b;
    struct random r;

    (void)state;
    random_seed(&r, (uint64_t[]){3}, 1);
    assert_int_equal(stationary_create(&a, SAMPLES, true), 0);
    assert_int_equal(stationary_create(&b, SAMPLES, true), 0);
    for (int k = 0; k < 20; k++) {
        add_noise(x, 1.0, &r);
        for (size_t i = 0; i < SAMPLES; i++)
            wide[3 * i] = x[i] = crealf(x[i]);
        stationary_take(a, x, 1);
        stationary_take(b, wide, 3);
    }
    stationary_judge(a, together);
    stationary_judge(b, apart);
    assert_memory_equal(apart, together, stationary_parts(a) * sizeof *apart);
    stationary_destroy(a);
    stationary_destroy(b);
}

static void traces_that_are_too_short_are_refused(void **state)
{
    struct stationary *s;

    (void)state;
    assert_int_equal(stationary_create(&s, 127, false), -EINVAL);
    assert_null(s);
    assert_int_equal(stationary_create(&s, 128, false), 0);
    stationary_destroy(s);
    assert_int_equal(stationary_create(&s, 255, true), -EINVAL);
    assert_int_equal(stationary_create(&s, 256, true), 0);
    stationary_destroy(s);
    stationary_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(many_traces_tell_echoes_from_noise),
        cmocka_unit_test(traces_of_unlike_strength_are_told_apart_too),
        cmocka_unit_test(few_traces_of_an_echo_are_not_sure),
        cmocka_unit_test(real_traces_with_others_between_are_judged_alike),
        cmocka_unit_test(traces_that_are_too_short_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
