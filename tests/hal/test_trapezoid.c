/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "hal/random.h"
#include "hal/stage/stepper.h"

static void assert_near(double x, double expected, double tolerance)
{
    if (!(fabs(x - expected) <= tolerance))
        fail_msg("%.12g, expected %.12g", x, expected);
}

/* 0.2 m/s, 0.5 m/s2: 0.4 s and 0.04 m for each ramp. */
static void a_long_way_takes_its_length_over_speed_and_one_ramp_more(void **state)
{
    struct trapezoid t;
    double v;
    (void)state;
    trapezoid_plan(&t, 1, 0, 1.3, 0.2, 0.5);
    assert_near(trapezoid_duration_s(&t), 0.3 / 0.2 + 0.2 / 0.5, 1e-12);
    assert_near(trapezoid_at(&t, 0.4, &v), 1.04, 1e-12);
    assert_near(v, 0.2, 1e-12);
    assert_near(trapezoid_time_s(&t, 1.14), 0.9, 1e-12);
}

static void a_short_way_is_a_triangle(void **state)
{
    struct trapezoid t;
    double v;
    (void)state;
    trapezoid_plan(&t, 0, 0, -0.02, 0.2, 0.5);
    assert_near(trapezoid_duration_s(&t), 2 * sqrt(0.02 / 0.5), 1e-12);
    assert_near(trapezoid_at(&t, 0.2, &v), -0.01, 1e-12);
    assert_near(v, -0.1, 1e-12);
}

static double one_of(struct random *r, double low, double high)
{
    return low + (high - low) * random_even(r);
}

/* Speed and acceleration from differences of the position, which know no pieces. */
static void no_plan_exceeds_speed_or_acceleration_or_misses_its_target(void **state)
{
    struct random r;
    (void)state;
    random_seed(&r, &(uint64_t){3}, 1);
    for (int i = 0; i < 300; i++) {
        double speed = one_of(&r, 0.05, 2), a = one_of(&r, 0.1, 10);
        double v0 = i % 3 ? one_of(&r, -speed, speed) : 0;
        double from = one_of(&r, -1, 1), to = one_of(&r, -1, 1), v;
        struct trapezoid t;
        trapezoid_plan(&t, from, v0, to, speed, a);
        double end_s = trapezoid_duration_s(&t), dt = end_s / 1000;
        double before = v0, x = from;
        for (int k = 1; k <= 1000; k++) {
            double next = trapezoid_at(&t, k * dt, &v);
            assert_true(fabs(next - x) <= speed * dt * (1 + 1e-9) + 1e-13);
            assert_true(fabs(v - before) <= a * dt * (1 + 1e-9) + 1e-9);
            before = v;
            x = next;
        }
        assert_near(trapezoid_at(&t, end_s, &v), to, 1e-12);
        assert_near(v, 0, 1e-7);
        assert_near(trapezoid_at(&t, end_s + 5, &v), to, 1e-12);
    }
}

static void the_time_of_a_place_is_when_it_is_there(void **state)
{
    struct random r;
    (void)state;
    random_seed(&r, &(uint64_t){4}, 1);
    for (int i = 0; i < 300; i++) {
        double speed = one_of(&r, 10, 5000), a = one_of(&r, 100, 50000), v;
        double n = floor(one_of(&r, 1, 3000)), sign = i % 2 ? 1 : -1;
        /* a speed from which it can still stop there */
        double v0 = i % 3 ? one_of(&r, 0, fmin(speed, sqrt(2 * a * n))) : 0;
        struct trapezoid t;
        trapezoid_plan(&t, 0, sign * v0, sign * n, speed, a);
        double before = 0;
        for (double k = 1; k <= n; k++) {
            double time_s = trapezoid_time_s(&t, sign * k);
            assert_true(time_s > before);
            assert_near(trapezoid_at(&t, time_s, &v), sign * k, 1e-6);
            before = time_s;
        }
        assert_near(before, trapezoid_duration_s(&t), 1e-6);
    }
}

/* At 1 m/s and 1 m/s2 it needs 0.5 m to stop: 0.3 m ahead is overshot, and reached from
 * behind; 0.8 m ahead is not. */
static void a_target_too_near_is_passed_and_come_back_to(void **state)
{
    struct trapezoid t;
    double v;
    (void)state;
    trapezoid_plan(&t, 0, 1, 0.3, 1, 1);
    assert_near(trapezoid_at(&t, 1, &v), 0.5, 1e-12);
    assert_near(v, 0, 1e-12);
    assert_near(trapezoid_duration_s(&t), 1 + 2 * sqrt(0.2), 1e-12);
    trapezoid_plan(&t, 0, 1, 0.8, 1, 1);
    assert_near(trapezoid_duration_s(&t), 0.3 + 1, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_long_way_takes_its_length_over_speed_and_one_ramp_more),
        cmocka_unit_test(a_short_way_is_a_triangle),
        cmocka_unit_test(no_plan_exceeds_speed_or_acceleration_or_misses_its_target),
        cmocka_unit_test(the_time_of_a_place_is_when_it_is_there),
        cmocka_unit_test(a_target_too_near_is_passed_and_come_back_to),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
