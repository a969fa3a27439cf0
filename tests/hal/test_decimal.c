/* SPDX-License-Identifier: MIT */
#include <float.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "hal/text_file.h"

static void decimals_are_short_where_they_can_be(void **state)
{
    char text[DECIMAL_SIZE];
    (void)state;
    assert_string_equal(decimal_print(0.01, text), "0.01");
    assert_string_equal(decimal_print(48000, text), "48000");
    assert_string_equal(decimal_print(-0.125, text), "-0.125");
}

static void decimals_read_back_to_the_same_number(void **state)
{
    const double numbers[] = {1.0 / 31, 0.1 + 0.2, -DBL_MAX, DBL_MIN, 343.21000000000004};
    char text[DECIMAL_SIZE];
    (void)state;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        assert_true(strtod(decimal_print(numbers[i], text), NULL) == numbers[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(decimals_are_short_where_they_can_be),
        cmocka_unit_test(decimals_read_back_to_the_same_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
