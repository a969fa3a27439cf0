/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/imaging/imager.h"

#define N 131 /* no multiple of a register */

static void fill(float complex *trace, float value)
{
    for (size_t n = 0; n < N; n++)
        trace[n] = value;
}

static void numbers_of_any_size_up_to_1e13_pass(void **state)
{
    (void)state;
    static const float good[6] = {0.0f, -0.0f, 1e-45f, -1e-40f, 1.0f, -9.9e12f};
    float complex trace[N];
    for (int q = 0; q < 6; q++) {
        fill(trace, good[q]);
        assert_true(trace_check(trace, N));
    }
    assert_true(trace_check(trace, 0));
}

static void one_part_of_one_sample_that_is_none_is_found_anywhere(void **state)
{
    (void)state;
    static const float bad[6] = {NAN, -NAN, INFINITY, -INFINITY, 1.01e13f, -3e38f};
    float complex trace[N];
    for (size_t q = 0; q < 6 * 2 * N; q++) {
        fill(trace, 1.0f);
        ((float *)trace)[q / 6] = bad[q % 6];
        assert_false(trace_check(trace, N));
        assert_true(trace_check(trace, q / 12)); /* what lies before it */
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_of_any_size_up_to_1e13_pass),
        cmocka_unit_test(one_part_of_one_sample_that_is_none_is_found_anywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
