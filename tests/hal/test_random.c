/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "hal/random.h"

enum { N = 200000 };

static void assert_gaussian(double sum, double squares, double quads)
{
    /* Five standard deviations of each estimate. */
    assert_true(fabs(sum / N) < 5 / sqrt(N));
    assert_true(fabs(squares / N - 1) < 5 * sqrt(2.0 / N));
    assert_true(fabs(quads / N - 3) < 5 * sqrt(96.0 / N));
}

static void normal_numbers_have_a_gaussians_moments(void **state)
{
    struct random r;
    double sum = 0, squares = 0, quads = 0;
    (void)state;
    random_seed(&r, (uint64_t[]){1}, 1);
    for (int i = 0; i < N; i++) {
        double x = random_normal(&r);
        sum += x;
        squares += x * x;
        quads += x * x * x * x;
    }
    assert_gaussian(sum, squares, quads);
}

static void noise_has_a_gaussians_moments_and_no_memory(void **state)
{
    static float x[N];
    struct random r;
    double sum = 0, squares = 0, quads = 0, neighbours = 0;
    (void)state;
    random_seed(&r, (uint64_t[]){2}, 1);
    memset(x, 0, sizeof x);
    random_add_noise(&r, x, N, 0.5f);
    for (int i = 0; i < N; i++) {
        double y = x[i] / 0.5;
        sum += y;
        squares += y * y;
        quads += y * y * y * y;
        neighbours += i ? y * x[i - 1] / 0.5 : 0;
    }
    assert_gaussian(sum, squares, quads);
    assert_true(fabs(neighbours / N) < 5 / sqrt(N));
}

static void noise_is_added_to_what_is_there(void **state)
{
    float x[3] = {1, 2, 3}, y[3] = {0, 0, 0};
    struct random r;
    (void)state;
    random_seed(&r, (uint64_t[]){3}, 1);
    random_add_noise(&r, x, 3, 1);
    random_seed(&r, (uint64_t[]){3}, 1);
    random_add_noise(&r, y, 3, 1);
    for (int i = 0; i < 3; i++)
        assert_true(fabsf(x[i] - (float)(i + 1) - y[i]) < 1e-6f);
}

static void each_tuple_has_a_sequence_of_its_own(void **state)
{
    static const uint64_t words[][2] = {{0, 0}, {0, 1}, {1, 0}, {1, 1}, {2, 0}};
    double first[5];
    struct random r;
    (void)state;
    for (int i = 0; i < 5; i++) {
        random_seed(&r, words[i], 2);
        first[i] = random_even(&r);
        random_seed(&r, words[i], 2);
        assert_true(random_even(&r) == first[i]);
        for (int j = 0; j < i; j++)
            assert_true(first[j] != first[i]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normal_numbers_have_a_gaussians_moments),
        cmocka_unit_test(noise_has_a_gaussians_moments_and_no_memory),
        cmocka_unit_test(noise_is_added_to_what_is_there),
        cmocka_unit_test(each_tuple_has_a_sequence_of_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
