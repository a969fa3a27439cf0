/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "dsp/window.h"
#include "tests/dsp/near.h"

static void each_window_is_one_in_the_middle_and_nothing_outside(void **state)
{
    (void)state;
    for (int w = WINDOW_RECTANGULAR; w <= WINDOW_HAMMING; w++) {
        assert_near(window_weight(w, 0.5), 1.0, 1e-12);
        assert_near(window_weight(w, -0.001), 0.0, 0.0);
        assert_near(window_weight(w, 1.001), 0.0, 0.0);
        assert_near(window_weight(w, NAN), 0.0, 0.0);
    }
}

static void edges_and_quarters_are_those_of_the_textbook(void **state)
{
    (void)state;
    assert_near(window_weight(WINDOW_RECTANGULAR, 0.0), 1.0, 0.0);
    assert_near(window_weight(WINDOW_HANN, 0.0), 0.0, 1e-12);
    assert_near(window_weight(WINDOW_HANN, 0.25), 0.5, 1e-12);
    assert_near(window_weight(WINDOW_HAMMING, 1.0), 0.08, 1e-12);
    assert_near(window_weight(WINDOW_HAMMING, 0.75), 0.54, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_window_is_one_in_the_middle_and_nothing_outside),
        cmocka_unit_test(edges_and_quarters_are_those_of_the_textbook),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
