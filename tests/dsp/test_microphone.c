/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/microphone.h"
#include "tests/dsp/near.h"

static void gain_is_linear_in_db_between_points_and_constant_outside(void **state)
{
    const double f[] = {100.0, 200.0, 1000.0}, g[] = {0.0, 6.0, -20.0};
    const struct microphone m = {3, f, g};

    (void)state;
    assert_near(microphone_gain(&m, 1.0), 1.0, 1e-12);
    assert_near(microphone_gain(&m, 150.0), 1.4125375446227544, 1e-12); /* 3 dB */
    assert_near(microphone_gain(&m, 200.0), 1.9952623149688795, 1e-12);
    assert_near(microphone_gain(&m, 600.0), 0.4466835921509631, 1e-12); /* -7 dB */
    assert_near(microphone_gain(&m, 1e5), 0.1, 1e-12);
}

static void without_a_curve_the_gain_is_1(void **state)
{
    const struct microphone m = {0};

    (void)state;
    assert_near(microphone_gain(&m, 1000.0), 1.0, 0.0);
}

static void a_correction_undoes_the_gain_by_20_db_at_most(void **state)
{
    const double f[] = {100.0, 200.0, 300.0}, g[] = {6.0, -26.0, 26.0};
    const struct microphone m = {3, f, g};

    (void)state;
    assert_near(microphone_correction(&m, 100.0), 0.5011872336272722, 1e-12);
    assert_near(microphone_correction(&m, 150.0), 3.1622776601683795, 1e-12); /* 10 dB */
    assert_near(microphone_correction(&m, 200.0), 10.0, 1e-12);
    assert_near(microphone_correction(&m, 300.0), 0.1, 1e-12);
    assert_near(microphone_correction(NULL, 100.0), 1.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gain_is_linear_in_db_between_points_and_constant_outside),
        cmocka_unit_test(without_a_curve_the_gain_is_1),
        cmocka_unit_test(a_correction_undoes_the_gain_by_20_db_at_most),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
