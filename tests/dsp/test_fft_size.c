/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/fft.h"

static void a_size_has_only_small_factors_and_is_inside_the_slack(void **state)
{
    (void)state;
    for (size_t min = 1; min < 5000; min += 7) {
        size_t n = fft_size(min, 1.25), rest = n;

        assert_true(n >= min && (min < 8 || (double)n <= 1.25 * (double)min));
        while (rest % 2 == 0)
            rest /= 2;
        while (rest % 3 == 0)
            rest /= 3;
        while (rest % 5 == 0)
            rest /= 5;
        assert_int_equal(rest, 1);
    }
}

static void without_slack_it_is_the_next_that_has_them(void **state)
{
    (void)state;
    assert_int_equal(fft_size(1, 1.0), 1);
    assert_int_equal(fft_size(0, 1.0), 1);
    assert_int_equal(fft_size(7, 1.0), 8);
    assert_int_equal(fft_size(3001, 1.0), 3072);
    assert_int_equal(fft_size(4097, 1.0), 4320);
}

static void a_power_of_two_in_reach_wins(void **state)
{
    (void)state;
    assert_int_equal(fft_size(3500, 1.25), 4096);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_size_has_only_small_factors_and_is_inside_the_slack),
        cmocka_unit_test(without_slack_it_is_the_next_that_has_them),
        cmocka_unit_test(a_power_of_two_in_reach_wins),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
