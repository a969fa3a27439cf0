/* SPDX-License-Identifier: MIT */
#include <complex.h>
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "dsp/trace_mean.h"

enum { PINGS = 2, CHANNELS = 2, SAMPLES = 37 };

static struct trace_mean *make(void)
{
    struct trace_mean *m;

    assert_int_equal(trace_mean_create(&m, PINGS, CHANNELS, SAMPLES), 0);
    return m;
}

static uint32_t take(struct trace_mean *m, size_t ping, size_t channel, double share,
                     float complex value, float complex *rest)
{
    float complex x[SAMPLES];

    for (size_t i = 0; i < SAMPLES; i++)
        x[i] = value;
    uint32_t before = trace_mean_take(m, ping, channel, share, 0, x);
    for (size_t i = 1; i < SAMPLES; i++)
        assert_true(x[i] == x[0]);
    *rest = x[0];
    return before;
}

static void each_is_subtracted_the_mean_of_those_before_it(void **state)
{
    struct trace_mean *m = make();
    double complex sum = 0;
    float complex rest;

    (void)state;
    for (unsigned i = 0; i < 20; i++) {
        float complex value = (float)(i * i % 7) - 2.0f * I * (float)i;
        assert_int_equal(take(m, 1, 0, 0.0, value, &rest), i);
        assert_true(cabs(rest - (value - (i ? sum / i : 0))) < 1e-4);
        sum += value;
        assert_true(cabs(trace_mean_of(m, 1)[0] - sum / (i + 1)) < 1e-4);
    }
    /* Other channels and pings know nothing of it. */
    assert_true(trace_mean_of(m, 1)[SAMPLES] == 0);
    assert_true(trace_mean_of(m, 0)[0] == 0);
    assert_int_equal(take(m, 1, 1, 0.0, 3, &rest), 0);
    assert_true(rest == 3);
    trace_mean_destroy(m);
}

/* With a share s what was there once is (1 - s)^n after n more. */
static void older_sound_fades_away_by_the_share(void **state)
{
    struct trace_mean *m = make();
    float complex rest;

    (void)state;
    for (unsigned i = 0; i < 200; i++)
        take(m, 0, 1, 0.125, 8, &rest);
    assert_true(cabsf(rest) < 1e-5f);
    for (unsigned i = 0; i < 10; i++) {
        take(m, 0, 1, 0.125, 0, &rest);
        assert_true(fabs(crealf(rest) + 8 * pow(0.875, i)) < 1e-4);
    }
    trace_mean_destroy(m);
}

/* Sample 3 stands still; something that moves is at 10, then at 20, then gone. */
static void what_moves_leaves_no_ghost_in_a_mean_of_few(void **state)
{
    struct trace_mean *m = make();
    float complex x[SAMPLES] = {[3] = 2 * I, [10] = 4};

    (void)state;
    assert_int_equal(trace_mean_take(m, 0, 0, 0.0, 3, x), 0);
    assert_true(x[3] == 2 * I && x[10] == 4); /* nothing is known yet */
    memset(x, 0, sizeof x);
    x[3] = 2 * I;
    x[20] = 4;
    assert_int_equal(trace_mean_take(m, 0, 0, 0.0, 3, x), 1);
    assert_true(x[3] == 0 && x[10] == 0 && x[20] == 4);
    assert_true(trace_mean_of(m, 0)[10] == 2); /* but the mean is one */
    memset(x, 0, sizeof x);
    x[3] = 2 * I;
    x[10] = 0.5f; /* something that stands, fainter than half of the ghost */
    x[20] = 1.5f; /* and louder */
    assert_int_equal(trace_mean_take(m, 0, 0, 0.0, 3, x), 2);
    assert_true(x[3] == 0 && x[10] == 0.5f && x[20] == -0.5f);
    memset(x, 0, sizeof x);
    assert_int_equal(trace_mean_take(m, 0, 0, 0.0, 3, x), 3); /* enough */
    assert_true(cabsf(x[3] + 2 * I) < 1e-6f);
    assert_true(fabsf(crealf(x[10]) + 4.5f / 3) < 1e-6f);
    trace_mean_destroy(m);
}

static void a_reset_forgets_all(void **state)
{
    struct trace_mean *m = make();
    float complex rest;

    (void)state;
    take(m, 0, 0, 0.0, 5, &rest);
    trace_mean_reset(m);
    assert_true(trace_mean_of(m, 0)[0] == 0);
    assert_int_equal(take(m, 0, 0, 0.0, 2, &rest), 0);
    assert_true(rest == 2);
    trace_mean_destroy(m);
}

static void sizes_that_make_no_sense_are_refused(void **state)
{
    struct trace_mean *m;

    (void)state;
    assert_int_equal(trace_mean_create(&m, 0, 1, 1), -EINVAL);
    assert_int_equal(trace_mean_create(&m, SIZE_MAX, 2, 2), -ENOMEM);
    trace_mean_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_is_subtracted_the_mean_of_those_before_it),
        cmocka_unit_test(older_sound_fades_away_by_the_share),
        cmocka_unit_test(what_moves_leaves_no_ghost_in_a_mean_of_few),
        cmocka_unit_test(a_reset_forgets_all),
        cmocka_unit_test(sizes_that_make_no_sense_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
