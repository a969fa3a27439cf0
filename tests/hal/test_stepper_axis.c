/* SPDX-License-Identifier: MIT */
/* The rail: 10 steps a millimetre, the home switch opens above step 1000 of the motor's
 * own count, the far one closes at 7000; the axis knows of none of that. */
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

struct bench {
    struct rail *rail;
    struct stepper_axis axis;
};

static const struct stepper_config stepper = {
    .acceleration = 5000, .direction_setup_ns = 20000, .pulse_ns = 5000};
static const struct stepper_axis_config standard = {.steps_per_m = 10000,
                                                    .speed_m_s = 0.1,
                                                    .home_speed_m_s = 0.05,
                                                    .min_m = 0,
                                                    .max_m = 0.5,
                                                    .back_off_m = 0.005,
                                                    .has_home = true};

static void setup(struct bench *b, const struct stepper_axis_config *cfg, int64_t at)
{
    b->rail = rail_create();
    b->rail->motor = b->rail->stage_client = at;
    b->rail->home_at = 1000;
    b->rail->limit_at = 7000;
    const struct stepper_io io = rail_io(b->rail);
    stepper_axis_init(&b->axis, cfg, &stepper, &io);
}

static void assert_homed(struct bench *b, int64_t at)
{
    assert_int_equal(stepper_axis_home(&b->axis), 0);
    assert_true(b->axis.homed);
    assert_int_equal(b->rail->motor, at);
    assert_true(stepper_axis_position_m(&b->axis) == b->axis.cfg.min_m);
}

/* 0 is 5 mm above where the switch closes, from wherever it starts, also on the switch.
 */
static void homing_ends_at_the_same_place_from_everywhere(void **state)
{
    static const int64_t starts[] = {5000, 1001, 1000, 999, 990, 810, 6999, 7000};
    (void)state;
    for (size_t i = 0; i < sizeof starts / sizeof *starts; i++) {
        struct bench b;
        setup(&b, &standard, starts[i]);
        assert_homed(&b, 1000 + 50);
        assert_int_equal(b.axis.homings, 1);
        assert_int_equal(b.axis.limit_hits, 0);
        free(b.rail);
    }
}

/* The switch is found fast, and found again at a tenth of that speed: 50 steps/s. */
static void the_switch_is_found_again_slowly(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 5000);
    assert_homed(&b, 1050);
    uint64_t last = b.rail->n - 1 - 50; /* before the final 5 mm */
    double slow_s = 1e-9 * (double)(b.rail->times_ns[last] - b.rail->times_ns[last - 1]);
    double fast_s = 1e-9 * (double)(b.rail->times_ns[2000] - b.rail->times_ns[1999]);
    assert_true(fabs(slow_s * 50 - 1) < 0.01);
    assert_true(fabs(fast_s * 500 - 1) < 0.01);
    free(b.rail);
}

static void a_switch_that_bounces_while_it_is_left_is_no_limit_that_was_hit(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 1500);
    b.rail->bounce = 20;
    assert_homed(&b, 1050);
    assert_int_equal(b.axis.limit_hits, 0);
    free(b.rail);
}

static void home_may_be_at_the_upper_end(void **state)
{
    struct stepper_axis_config cfg = standard;
    struct bench b;
    (void)state;
    cfg.home_positive = true;
    setup(&b, &cfg, 4000);
    b.rail->home_positive = true;
    b.rail->home_at = 7000;
    b.rail->limit_at = 1000;
    assert_int_equal(stepper_axis_home(&b.axis), 0);
    assert_int_equal(b.rail->motor, 7000 - 50);
    assert_true(stepper_axis_position_m(&b.axis) == 0.5);
    assert_int_equal(stepper_axis_move(&b.axis, 0.2, 0), 0);
    assert_int_equal(b.rail->motor, 7000 - 50 - 3000);
    free(b.rail);
}

static void without_a_switch_where_it_stands_is_declared_the_end(void **state)
{
    struct stepper_axis_config cfg = standard;
    struct bench b;
    (void)state;
    cfg.has_home = false;
    setup(&b, &cfg, 3000);
    assert_int_equal(stepper_axis_move(&b.axis, 0.1, 0), -ESTALE);
    assert_homed(&b, 3000);
    assert_int_equal(stepper_axis_move(&b.axis, 0.1, 0), 0);
    assert_int_equal(b.rail->motor, 4000);
    free(b.rail);
}

static void a_switch_that_is_not_there_is_not_looked_for_for_ever(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 5000);
    b.rail->home_at = INT64_MIN;
    assert_int_equal(stepper_axis_home(&b.axis), -EIO);
    assert_non_null(strstr(b.axis.text, "no home switch was found"));
    assert_false(b.axis.homed);
    assert_in_range(b.rail->n, 5000, 6200);
    free(b.rail);
}

static void a_motor_that_is_wired_backwards_stops_at_the_far_switch(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 5000);
    b.rail->home_positive = true; /* the rail as seen by such a motor */
    b.rail->home_at = 7000;
    b.rail->limit_at = 1000;
    assert_int_equal(stepper_axis_home(&b.axis), -EIO);
    assert_non_null(strstr(b.axis.text, "far limit switch was hit"));
    assert_int_equal(b.rail->motor, 1000);
    free(b.rail);
}

static void moves_end_where_they_should_and_stay_inside_the_range(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 2000);
    assert_int_equal(stepper_axis_move(&b.axis, 0.1, 0), -ESTALE);
    assert_homed(&b, 1050);
    static const double targets_m[] = {0.1, 0.5, 0.0323, 0, 0.0323};
    for (size_t i = 0; i < sizeof targets_m / sizeof *targets_m; i++) {
        assert_int_equal(stepper_axis_move(&b.axis, targets_m[i], 0), 0);
        assert_int_equal(b.rail->motor, 1050 + llround(10000 * targets_m[i]));
        assert_true(fabs(stepper_axis_position_m(&b.axis) - targets_m[i]) < 1e-9);
    }
    assert_int_equal(stepper_axis_move(&b.axis, 0.5001, 0), -ERANGE);
    assert_int_equal(stepper_axis_move(&b.axis, -0.0001, 0), -ERANGE);
    assert_int_equal(stepper_axis_move(&b.axis, (double)NAN, 0), -ERANGE);
    assert_int_equal(b.rail->motor, 1050 + 323);
    free(b.rail);
}

static void a_limit_in_a_move_stops_it_at_once_and_its_place_is_lost(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 2000);
    assert_homed(&b, 1050);
    b.rail->limit_at = 2500; /* somebody left a box there */
    assert_int_equal(stepper_axis_move(&b.axis, 0.4, 0), -EIO);
    assert_int_equal(b.rail->motor, 2500);
    assert_non_null(strstr(b.axis.text, "far limit switch was hit"));
    assert_int_equal(b.axis.limit_hits, 1);
    assert_int_equal(stepper_axis_move(&b.axis, 0, 0), -ESTALE);
    assert_homed(&b, 1050); /* leaves the switch that it stands on */
    assert_int_equal(stepper_axis_move(&b.axis, 0.1, 0), 0);
    free(b.rail);
}

static void the_emergency_stop_lets_go_of_the_motor_and_bars_homing(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 2000);
    assert_homed(&b, 1050);
    b.rail->estop_after = b.rail->n + 500;
    assert_int_equal(stepper_axis_move(&b.axis, 0.4, 0), -ESHUTDOWN);
    assert_int_equal(b.rail->motor, 1550);
    assert_false(b.rail->enabled);
    assert_int_equal(b.axis.estops, 1);
    uint64_t before = b.rail->n;
    assert_int_equal(stepper_axis_home(&b.axis), -ESHUTDOWN);
    assert_int_equal(b.rail->n, before);
    b.rail->estop_after = 0;
    assert_homed(&b, 1050);
    free(b.rail);
}

static void a_switch_that_closes_at_rest_is_a_fault_once(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 2000);
    assert_int_equal(stepper_axis_watch(&b.axis), 0);
    assert_homed(&b, 1050);
    assert_int_equal(stepper_axis_watch(&b.axis), 0);
    b.rail->estop_after = 1;
    assert_int_equal(stepper_axis_watch(&b.axis), -ESHUTDOWN);
    assert_int_equal(stepper_axis_watch(&b.axis), 0);
    assert_int_equal(b.axis.estops, 1);
    assert_false(b.axis.homed);
    free(b.rail);
}

static void the_emergency_stop_lets_go_of_a_motor_whose_place_is_lost(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 2000);
    assert_homed(&b, 1050);
    b.rail->limit_at = 3000; /* something is in the way */
    assert_int_equal(stepper_axis_move(&b.axis, 0.4, 0), -EIO);
    assert_true(b.rail->enabled);
    b.rail->limit_at = 7000;
    b.rail->estop_after = 1;
    assert_int_equal(stepper_axis_watch(&b.axis), -ESHUTDOWN);
    assert_false(b.rail->enabled);
    assert_int_equal(stepper_axis_watch(&b.axis), 0);
    assert_int_equal(b.axis.estops, 1);
    free(b.rail);
}

/* A broken wire reads as pressed: 0.5 m of range must not be driven because of it. */
static void a_home_switch_that_is_stuck_stops_the_homing_soon(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 3000);
    b.rail->home_at = 100000;
    assert_int_equal(stepper_axis_home(&b.axis), -EIO);
    assert_false(b.axis.homed);
    assert_true(b.rail->motor <= 3000 + 5 * 50 + 50);
    free(b.rail);
}

/* With 0.8 mm of play the stage client lags behind the motor going down, and is pulled
 * going up.  It has to stand at one place for one target, whichever side it came from. */
static void backlash_is_taken_up_from_one_side(void **state)
{
    static const double targets_m[] = {0.3, 0.1, 0.3, 0.2999, 0.3, 0.3001, 0.3, 0, 0.3};
    struct stepper_axis_config cfg = standard;
    struct bench b;
    (void)state;
    cfg.backlash_m = 0.001;
    setup(&b, &cfg, 2000);
    b.rail->play = 8;
    assert_int_equal(stepper_axis_home(&b.axis), 0);
    int64_t zero = b.rail->stage_client;
    for (size_t i = 0; i < sizeof targets_m / sizeof *targets_m; i++) {
        assert_int_equal(stepper_axis_move(&b.axis, targets_m[i], 0), 0);
        assert_int_equal(b.rail->stage_client - zero, llround(10000 * targets_m[i]));
    }
    /* Also when a move down was broken off, and the next is a little way up. */
    b.rail->cancel_after = b.rail->n + 1000;
    assert_int_equal(stepper_axis_move(&b.axis, 0.05, 0), -ECANCELED);
    assert_true(b.axis.homed);
    b.rail->cancel_after = 0;
    double here_m = stepper_axis_position_m(&b.axis);
    assert_int_equal(stepper_axis_move(&b.axis, here_m + 0.0002, 0), 0);
    assert_int_equal(b.rail->stage_client - zero, llround(10000 * (here_m + 0.0002)));
    free(b.rail);
}

static void a_homing_that_is_broken_off_leaves_no_place(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 5000);
    b.rail->cancel_after = 100;
    assert_int_equal(stepper_axis_home(&b.axis), -ECANCELED);
    assert_false(b.axis.homed);
    free(b.rail);
}

/* Between its ramps each step comes as it is told: 62 mm/s are 620 steps/s. */
static void a_move_goes_as_fast_as_it_is_told(void **state)
{
    struct bench b;
    (void)state;
    setup(&b, &standard, 5000);
    assert_homed(&b, 1050);
    uint64_t first = b.rail->n;
    assert_int_equal(stepper_axis_move(&b.axis, 0.3, 0.062), 0);
    for (uint64_t i = first + 200; i < first + 2800; i++) {
        double step_s = 1e-9 * (double)(b.rail->times_ns[i] - b.rail->times_ns[i - 1]);
        assert_true(fabs(step_s * 620 - 1) < 1e-3);
    }
    first = b.rail->n;
    assert_int_equal(stepper_axis_move(&b.axis, 0, 0), 0); /* its own again */
    double own_s =
        1e-9 * (double)(b.rail->times_ns[first + 1500] - b.rail->times_ns[first + 1499]);
    assert_true(fabs(own_s * 1000 - 1) < 0.01);
    free(b.rail);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_move_goes_as_fast_as_it_is_told),
        cmocka_unit_test(homing_ends_at_the_same_place_from_everywhere),
        cmocka_unit_test(the_switch_is_found_again_slowly),
        cmocka_unit_test(a_switch_that_bounces_while_it_is_left_is_no_limit_that_was_hit),
        cmocka_unit_test(home_may_be_at_the_upper_end),
        cmocka_unit_test(without_a_switch_where_it_stands_is_declared_the_end),
        cmocka_unit_test(a_switch_that_is_not_there_is_not_looked_for_for_ever),
        cmocka_unit_test(a_motor_that_is_wired_backwards_stops_at_the_far_switch),
        cmocka_unit_test(moves_end_where_they_should_and_stay_inside_the_range),
        cmocka_unit_test(a_limit_in_a_move_stops_it_at_once_and_its_place_is_lost),
        cmocka_unit_test(the_emergency_stop_lets_go_of_the_motor_and_bars_homing),
        cmocka_unit_test(a_switch_that_closes_at_rest_is_a_fault_once),
        cmocka_unit_test(the_emergency_stop_lets_go_of_a_motor_whose_place_is_lost),
        cmocka_unit_test(a_home_switch_that_is_stuck_stops_the_homing_soon),
        cmocka_unit_test(backlash_is_taken_up_from_one_side),
        cmocka_unit_test(a_homing_that_is_broken_off_leaves_no_place),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
