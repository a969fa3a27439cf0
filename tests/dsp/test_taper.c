/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/window.h"

enum { N = 64 };

static void the_middle_stays_and_the_ends_fade_evenly(void **state)
{
    float x[N], y[N];

    (void)state;
    for (size_t i = 0; i < N; i++)
        x[i] = 1.0f;
    taper_ends(x, N, 16, 8, y);
    for (size_t i = 16; i < N - 8; i++)
        assert_true(y[i] == 1.0f);
    for (size_t i = 0; i < 16; i++) {
        double expected = pow(sin(M_PI / 2 * ((double)i + 0.5) / 16), 2);
        assert_true(fabs(y[i] - expected) < 1e-6);
        assert_true(fabs(y[i] + y[15 - i] - 1) < 1e-6); /* and its reverse make 1 */
    }
    for (size_t i = 0; i < 8; i++) {
        double expected = pow(sin(M_PI / 2 * ((double)i + 0.5) / 8), 2);
        assert_true(fabs(y[N - 1 - i] - expected) < 1e-6);
    }
}

static void without_lengths_nothing_changes_and_in_place_it_is_the_same(void **state)
{
    float x[N], y[N];

    (void)state;
    for (size_t i = 0; i < N; i++)
        x[i] = (float)i - 20;
    taper_ends(x, N, 0, 0, y);
    for (size_t i = 0; i < N; i++)
        assert_true(y[i] == x[i]);
    taper_ends(x, N, 5, 100, y);
    taper_ends(x, N, 5, 100, x);
    for (size_t i = 0; i < N; i++)
        assert_true(y[i] == x[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_middle_stays_and_the_ends_fade_evenly),
        cmocka_unit_test(without_lengths_nothing_changes_and_in_place_it_is_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
