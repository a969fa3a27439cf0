/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/nodes/near.h"

#include "nodes/array/acquisition.h"

#define SECOND_NS 1000000000LL

static Anlos__Ambient say(double temperature_c, double humidity)
{
    Anlos__Ambient a = ANLOS__AMBIENT__INIT;

    a.temperature_c = temperature_c;
    a.humidity = humidity;
    return a;
}

/* Slots of 24 ms, 4.12 m. */
static const struct survey measured = {.temperature_c = 20.0,
                                       .sound_speed_m_s = 343.4,
                                       .sample_rate_hz = 48000.0,
                                       .chirp_duration_s = 0.02,
                                       .slot_samples = 1152,
                                       .has_gate = true,
                                       .gate_m = {1.5, 4.0}};

/* Textbooks: 331.5 m/s in dry air of 0 C, 354.9 at 40 C; 0.6 m/s more at 20 C where half
 * of what it can hold is water. */
static void sound_goes_as_fast_as_the_air_lets_it(void **state)
{
    static const struct {
        double temperature_c, humidity, speed_m_s;
    } cases[] = {{0.0, NAN, 331.5}, {40.0, 0.0, 354.9}, {-15.0, NAN, 322.3}};

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct survey s = measured;
        struct ambient air = {0};
        Anlos__Ambient a = say(cases[i].temperature_c, cases[i].humidity);
        assert_true(ambient_take(&air, &measured, &s, &a, SECOND_NS));
        assert_near(s.sound_speed_m_s, cases[i].speed_m_s, 0.4);
        assert_near(s.temperature_c, cases[i].temperature_c, 0.0);
    }
    struct survey dry = measured, humid = measured;
    struct ambient first = {0}, second = {0};
    Anlos__Ambient a = say(25.0, 0.0), b = say(25.0, 0.5);
    assert_true(ambient_take(&first, &measured, &dry, &a, SECOND_NS));
    assert_true(ambient_take(&second, &measured, &humid, &b, SECOND_NS));
    assert_near(humid.sound_speed_m_s - dry.sound_speed_m_s, 0.85, 0.3);
}

/* Imaging restarts with each change: a kelvin, 7 mm at 4 m, is not worth it. */
static void what_hardly_differs_changes_nothing(void **state)
{
    struct survey s = measured;
    struct ambient air = {0};
    Anlos__Ambient warmer = say(21.0, NAN), warm = say(22.0, NAN);

    (void)state;
    assert_false(ambient_take(&air, &measured, &s, &warmer, SECOND_NS));
    assert_near(s.sound_speed_m_s, 343.4, 0.0);
    assert_true(ambient_take(&air, &measured, &s, &warm, SECOND_NS));
}

static void it_changes_once_a_minute_at_most(void **state)
{
    struct survey s = measured;
    struct ambient air = {0};
    Anlos__Ambient cold = say(0.0, NAN), warm = say(30.0, NAN);

    (void)state;
    assert_true(ambient_take(&air, &measured, &s, &cold, SECOND_NS));
    assert_false(ambient_take(&air, &measured, &s, &warm, 60 * SECOND_NS));
    assert_near(s.temperature_c, 0.0, 0.0);
    assert_true(ambient_take(&air, &measured, &s, &warm, 62 * SECOND_NS));
    assert_near(s.temperature_c, 30.0, 0.0);
}

/* Its echoes from 4 m come after the next emission. */
static void in_colder_air_the_gate_ends_with_the_slot(void **state)
{
    struct survey s = measured;
    struct ambient air = {0};
    Anlos__Ambient cold = say(-15.0, NAN), warm = say(20.0, NAN);

    (void)state;
    assert_true(ambient_take(&air, &measured, &s, &cold, SECOND_NS));
    assert_near(s.gate_m[1], 0.5 * 0.024 * s.sound_speed_m_s, 1e-9);
    assert_true(s.gate_m[1] < 3.9);
    s.chirp_duration_s =
        0.0625; /* others sound while it is heard: the gate ends earlier */
    s.sound_speed_m_s = 343.4;
    air.changed_ns = 0;
    assert_true(ambient_take(&air, &measured, &s, &cold, SECOND_NS));
    assert_true(s.gate_m[1] < 0.5 * 0.024 * s.sound_speed_m_s - 0.01);
    assert_true(ambient_take(&air, &measured, &s, &warm, 62 * SECOND_NS));
    assert_near(s.gate_m[1], 4.0, 0.0);
}

static void no_temperature_or_one_that_cannot_be_changes_nothing(void **state)
{
    static const double wrong[] = {NAN, INFINITY, -41.0, 85.0};
    struct survey s = measured;
    struct ambient air = {0};

    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        Anlos__Ambient a = say(wrong[i], 0.5);
        assert_false(ambient_take(&air, &measured, &s, &a, SECOND_NS));
    }
    assert_near(s.temperature_c, 20.0, 0.0);
    assert_near(s.sound_speed_m_s, 343.4, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sound_goes_as_fast_as_the_air_lets_it),
        cmocka_unit_test(what_hardly_differs_changes_nothing),
        cmocka_unit_test(it_changes_once_a_minute_at_most),
        cmocka_unit_test(in_colder_air_the_gate_ends_with_the_slot),
        cmocka_unit_test(no_temperature_or_one_that_cannot_be_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
