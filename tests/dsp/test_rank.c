/* SPDX-License-Identifier: MIT */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "dsp/rank.h"

enum { MOST = 500 };

static uint32_t next(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed >> 8;
}

static int by_value(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* Each rank of x[n] against sorting. */
static void check(const float *x, size_t n)
{
    float sorted[MOST];

    for (size_t i = 0; i < n; i++)
        sorted[i] = x[i];
    qsort(sorted, n, sizeof *sorted, by_value);
    for (size_t k = 1; k <= n; k++)
        assert_true(rank_smallest(x, n, k) == sorted[k - 1]);
    for (size_t k = 1; k <= n; k++) {
        double copy[MOST];
        for (size_t i = 0; i < n; i++)
            copy[i] = (double)x[i];
        assert_true(rank_double(copy, n, k) == (double)sorted[k - 1]);
        for (size_t i = 0; i < n; i++)
            assert_true(i < k ? copy[i] <= copy[k - 1] : copy[i] >= copy[k - 1]);
    }
}

static void every_rank_is_what_sorting_says(void **state)
{
    (void)state;
    uint32_t seed = 1;
    float x[MOST];

    for (size_t n = 1; n <= MOST; n += n < 40 ? 1 : 153) {
        for (size_t i = 0; i < n; i++)
            x[i] = (float)(1 + next(&seed));
        check(x, n);
    }
}

static void numbers_that_are_the_same_count_each(void **state)
{
    (void)state;
    uint32_t seed = 2;
    float x[MOST];

    for (size_t i = 0; i < MOST; i++)
        x[i] = (float)(1 + next(&seed) % 5);
    check(x, MOST);
    for (size_t i = 0; i < MOST; i++)
        x[i] = 0.25f;
    check(x, MOST);
}

/* Silence, as of a microphone without a signal. */
static void powers_of_0_have_a_rank_too(void **state)
{
    (void)state;
    float x[40] = {[7] = 3.0f, [20] = FLT_TRUE_MIN};

    check(x, 40);
    x[7] = x[20] = 0.0f;
    check(x, 40);
}

static void the_median_is_the_middle_or_the_mean_of_two(void **state)
{
    (void)state;
    double odd[] = {3.0, -INFINITY, 1.0}, even[] = {4.0, -1.0, 2.0, 1.0}, one[] = {7.0};

    assert_true(rank_median(odd, 3) == 1.0);
    assert_true(rank_median(even, 4) == 1.5);
    assert_true(rank_median(even, 2) == 0.0); /* of its smaller half, -1 and 1 */
    assert_true(rank_median(one, 1) == 7.0);
    assert_true(isnan(rank_median(one, 0)));
}

static void any_two_floats_are_told_apart(void **state)
{
    (void)state;
    static const float x[] = {FLT_MAX, FLT_TRUE_MIN, 1.0f + FLT_EPSILON, FLT_MIN, 1.0f};

    check(x, sizeof x / sizeof *x);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_rank_is_what_sorting_says),
        cmocka_unit_test(numbers_that_are_the_same_count_each),
        cmocka_unit_test(powers_of_0_have_a_rank_too),
        cmocka_unit_test(the_median_is_the_middle_or_the_mean_of_two),
        cmocka_unit_test(any_two_floats_are_told_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
