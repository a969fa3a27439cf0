/* SPDX-License-Identifier: MIT */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "hal/stage/stepper.h"
#include "rail.h"

static const struct stepper_config config = {.acceleration = 20000,
                                             .direction_setup_ns = 20000,
                                             .pulse_ns = 5000,
                                             .enable_ns = 1000000};

static enum stepper_end go(struct rail *r, struct stepper *s, int64_t target,
                           unsigned stop_on, struct stepper_run *run)
{
    const struct stepper_io io = rail_io(r);
    if (!s->io.now_ns)
        stepper_init(s, &config, &io);
    *run = (struct stepper_run){.target = target, .speed = 4000, .stop_on = stop_on};
    return stepper_go(s, run);
}

static double interval_s(const struct rail *r, uint64_t k)
{
    return 1e-9 * (double)(r->times_ns[k] - r->times_ns[k - 1]);
}

/* Between two steps the mean speed is that at mid-time, which changes by no more than the
 * acceleration has it.  4000 steps/s at 20000 steps/s2: ramps of 0.2 s and 400 steps. */
static void steps_keep_to_speed_and_acceleration_and_end_on_the_target(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    assert_int_equal(go(r, &s, 3000, 0, &run), STEPPER_ARRIVED);
    assert_int_equal(r->motor, 3000);
    assert_int_equal(s.position, 3000);
    assert_int_equal(s.steps, 3000);
    for (uint64_t k = 1; k < r->n; k++)
        assert_true(interval_s(r, k) >= 1 / 4000.0 - 2e-9);
    for (uint64_t k = 2; k < r->n; k++) {
        double before = interval_s(r, k - 1), now = interval_s(r, k);
        double change = fabs(1 / now - 1 / before) / (0.5 * (now + before));
        assert_true(change <= 20000 * 1.01);
    }
    double whole_s = 1e-9 * (double)(r->times_ns[2999] - r->times_ns[0]);
    /* all but the first step's interval from rest */
    double expected_s = 3000 / 4000.0 + 4000 / 20000.0 - sqrt(2 / 20000.0);
    assert_true(fabs(whole_s - expected_s) < 1e-4);
    assert_int_equal(s.late_steps, 0);
    free(r);
}

static int64_t now_and_then_late(struct rail *r)
{
    r->seed = r->seed * 6364136223846793005u + 1442695040888963407u;
    uint64_t x = r->seed >> 33;
    return x % 50 == 0 ? (int64_t)(x % 40000000) : (int64_t)(x % 30000);
}

/* Against the same way with no lateness: no step follows the one before it sooner. */
static void late_steps_stretch_the_way_and_are_never_made_up_for(void **state)
{
    struct rail *late = rail_create(), *ideal = rail_create();
    struct stepper a = {.position = 0}, b = {.position = 0};
    struct stepper_run run;
    (void)state;
    late->late_ns = now_and_then_late;
    assert_int_equal(go(ideal, &a, 5000, 0, &run), STEPPER_ARRIVED);
    assert_int_equal(go(late, &b, 5000, 0, &run), STEPPER_ARRIVED);
    assert_int_equal(late->motor, 5000);
    assert_int_equal(late->n, ideal->n);
    for (uint64_t k = 1; k < late->n; k++)
        assert_true(late->times_ns[k] - late->times_ns[k - 1] >=
                    ideal->times_ns[k] - ideal->times_ns[k - 1] - 2);
    assert_true(b.late_steps > 20);
    free(late);
    free(ideal);
}

/* After a stall of 40 ms at full speed the motor stands nearly still: it has to be
 * brought up to speed again, not thrown back into it. */
static int64_t one_stall(struct rail *r)
{
    return r->n == 1500 && r->seed++ == 0 ? 40000000 : 0;
}

static void after_a_stall_it_starts_from_the_speed_that_was_left(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    r->late_ns = one_stall;
    assert_int_equal(go(r, &s, 3000, 0, &run), STEPPER_ARRIVED);
    assert_int_equal(s.late_steps, 1);
    assert_true(interval_s(r, 1500) > 0.04);
    for (uint64_t k = 1502; k < r->n; k++) {
        double before = interval_s(r, k - 1), now = interval_s(r, k);
        assert_true((1 / now - 1 / before) / (0.5 * (now + before)) <= 20000 * 1.01);
    }
    assert_true(interval_s(r, 1501) > 0.005); /* sqrt(2 / 20000) = 10 ms from rest */
    free(r);
}

static void a_newer_command_brakes_it_to_rest(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    r->cancel_after = 1000; /* at full speed: 400 steps of braking */
    assert_int_equal(go(r, &s, 100000, 0, &run), STEPPER_CANCELLED);
    assert_int_equal(r->motor, s.position);
    assert_in_range(r->motor, 1399, 1402);
    for (uint64_t k = 1001; k < r->n; k++) {
        double before = interval_s(r, k - 1), now = interval_s(r, k);
        assert_true((1 / before - 1 / now) / (0.5 * (now + before)) <= 20000 * 1.02);
    }
    r->cancel_after = 0;
    assert_int_equal(go(r, &s, 0, 0, &run), STEPPER_ARRIVED);
    assert_int_equal(r->motor, 0);
    free(r);
}

static void a_switch_stops_it_before_the_next_step(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    r->estop_after = 1234;
    assert_int_equal(go(r, &s, 5000, STEPPER_BIT(STEPPER_ESTOP), &run), STEPPER_INPUT);
    assert_int_equal(run.active, STEPPER_BIT(STEPPER_ESTOP));
    assert_int_equal(r->n, 1234);
    assert_int_equal(s.position, 1234);
    free(r);
}

static void a_switch_that_was_closed_for_less_than_a_step_stops_it_too(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    r->blip_after = 77;
    assert_int_equal(go(r, &s, -5000, STEPPER_BIT(STEPPER_ESTOP), &run), STEPPER_INPUT);
    assert_int_equal(r->n, 77);
    assert_int_equal(r->motor, -77);
    free(r);
}

static void lines_that_fail_end_the_way_with_their_error(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    r->fail_after = 10;
    assert_int_equal(go(r, &s, 100, 0, &run), STEPPER_ERROR);
    assert_int_equal(run.error, -EIO);
    assert_int_equal(s.position, r->motor);
    free(r);
}

static void pulses_and_turns_last_as_long_as_the_driver_needs(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    assert_int_equal(go(r, &s, 50, 0, &run), STEPPER_ARRIVED);
    assert_int_equal(go(r, &s, -50, 0, &run), STEPPER_ARRIVED);
    assert_int_equal(r->motor, -50);
    assert_true(r->shortest_pulse_ns >= 5000);
    assert_true(r->shortest_low_ns >= 5000);
    assert_true(r->shortest_setup_ns >= 20000);
    assert_false(r->moved_disabled);
    free(r);
}

/* When a pulse ends so late that the next one is due already, there still is a pause. */
static void pulses_that_end_late_have_a_pause_between_them(void **state)
{
    struct rail *r = rail_create();
    struct stepper s = {.position = 0};
    struct stepper_run run;
    (void)state;
    r->late_ns = now_and_then_late;
    assert_int_equal(go(r, &s, 3000, 0, &run), STEPPER_ARRIVED);
    assert_true(r->shortest_pulse_ns >= 5000);
    assert_true(r->shortest_low_ns >= 5000);
    free(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(steps_keep_to_speed_and_acceleration_and_end_on_the_target),
        cmocka_unit_test(late_steps_stretch_the_way_and_are_never_made_up_for),
        cmocka_unit_test(after_a_stall_it_starts_from_the_speed_that_was_left),
        cmocka_unit_test(a_newer_command_brakes_it_to_rest),
        cmocka_unit_test(a_switch_stops_it_before_the_next_step),
        cmocka_unit_test(a_switch_that_was_closed_for_less_than_a_step_stops_it_too),
        cmocka_unit_test(lines_that_fail_end_the_way_with_their_error),
        cmocka_unit_test(pulses_and_turns_last_as_long_as_the_driver_needs),
        cmocka_unit_test(pulses_that_end_late_have_a_pause_between_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
