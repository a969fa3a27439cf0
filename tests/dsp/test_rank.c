#include <float.h>
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
        cmocka_unit_test(any_two_floats_are_told_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
