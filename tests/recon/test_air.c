/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "recon/frontend/backgrounds.h"
#include "recon/survey.h"
#include "tests/nodes/near.h"

/* Cramer's formula for the speed, against the square root law here. */
static void a_stretch_tells_the_kelvins_that_it_would_be(void **state)
{
    static const double at_c[] = {-5.0, 20.0, 35.0};
    struct air a;

    (void)state;
    for (int i = 0; i < 3; i++) {
        double c = survey_sound_speed_m_s(at_c[i]);
        air_start(&a, c, 1);
        assert_near(air_kelvin(&a, c / survey_sound_speed_m_s(at_c[i] + 0.5) - 1.0), 0.5,
                    0.015);
    }
}

static void nothing_corrected_is_nothing_to_say(void **state)
{
    char text[160] = "x";
    struct air a;

    (void)state;
    air_start(&a, 343.0, 2);
    air_text(&a, text, sizeof text);
    assert_string_equal(text, "");
    air_add(&a, 1e-7, false);
    air_text(&a, text, sizeof text);
    assert_string_equal(text, "");
}

/* 343 m/s is sound of 292.7 K. */
static void the_text_has_mean_and_largest_with_their_signs(void **state)
{
    char text[160];
    struct air a;

    (void)state;
    air_start(&a, 343.0, 2);
    air_add(&a, 0.0011, true);
    air_add(&a, 0.0021, true);
    air_text(&a, text, sizeof text);
    assert_string_equal(
        text, "air -0.9 K (0.16%) since the background, at most -1.2 K (0.21%)");
    assert_int_equal(a.pings, 2);
    assert_int_equal(a.corrected, 2);
}

static void a_large_change_is_distrusted_of_either_sign(void **state)
{
    struct air a;

    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        air_start(&a, 343.0, 2);
        air_add(&a, sign * 0.0039, true);
        assert_false(air_is_distrusted(&a));
        air_add(&a, sign * 0.0041, true);
        air_add(&a, 0.0, false);
        assert_true(air_is_distrusted(&a));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_stretch_tells_the_kelvins_that_it_would_be),
        cmocka_unit_test(nothing_corrected_is_nothing_to_say),
        cmocka_unit_test(the_text_has_mean_and_largest_with_their_signs),
        cmocka_unit_test(a_large_change_is_distrusted_of_either_sign),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
