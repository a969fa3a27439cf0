/* SPDX-License-Identifier: MIT */
#include "scratch.h"

#include <errno.h>
#include <math.h>

#include "hal/stage.h"

static struct stage *open_stage(const char *uri, struct fake_clock *clock)
{
    struct error why = {.text = ""};
    struct stage *s;
    fake_clock_set(clock, INT64_C(1700000000000000000));
    if (stage_open(&s, uri, &clock->source, &why))
        fail_msg("%s", why.text);
    return s;
}

static void assert_at(struct stage *s, struct fake_clock *c, double after_s,
                      enum stage_motion motion, double position_m)
{
    struct stage_status status;
    int64_t start_ns = c->now_ns;
    c->now_ns += (int64_t)llround(after_s * 1e9);
    stage_status(s, &status);
    c->now_ns = start_ns;
    if (status.motion != motion || fabs(status.position_m - position_m) > 1e-7)
        fail_msg("after %g s: motion %d at %.9f m, expected %d at %.9f m", after_s,
                 status.motion, status.position_m, motion, position_m);
}

/* 0.2 m/s, 0.5 m/s2, 0.3 m: 0.4 s and 0.04 m of acceleration, 0.22 m at full speed in
 * 1.1 s, 0.4 s of braking: 1.9 s. */
static void a_long_move_is_a_trapezoid(void **state)
{
    struct fake_clock clock;
    struct stage *s =
        open_stage("sim:?speed=0.2&acceleration=0.5&settle=0.15&error=0", &clock);
    (void)state;
    assert_at(s, &clock, 0, STAGE_IDLE, 0);
    assert_int_equal(stage_move(s, 0.3), 0);
    assert_at(s, &clock, 0.2, STAGE_MOVING, 0.5 * 0.5 * 0.2 * 0.2);
    assert_at(s, &clock, 0.4, STAGE_MOVING, 0.04);
    assert_at(s, &clock, 0.9, STAGE_MOVING, 0.14);
    assert_at(s, &clock, 1.5, STAGE_MOVING, 0.26);
    assert_at(s, &clock, 1.7, STAGE_MOVING, 0.3 - 0.5 * 0.5 * 0.2 * 0.2);
    assert_at(s, &clock, 1.91, STAGE_SETTLING, 0.3);
    assert_at(s, &clock, 2.04, STAGE_SETTLING, 0.3);
    assert_at(s, &clock, 2.06, STAGE_IDLE, 0.3);
    stage_close(s);
}

/* 0.062 m/s: 0.124 s and 3.844 mm of acceleration, then straight on. */
static void a_move_goes_as_fast_as_it_is_told(void **state)
{
    struct fake_clock clock;
    struct stage *s = open_stage("sim:?error=0", &clock);
    struct stage_status status;
    (void)state;
    assert_int_equal(stage_move_at(s, 1, 0.062), 0);
    assert_at(s, &clock, 1, STAGE_MOVING, 0.003844 + 0.062 * (1 - 0.124));
    assert_at(s, &clock, 10, STAGE_MOVING, 0.003844 + 0.062 * (10 - 0.124));
    clock.now_ns += 123;
    stage_status(s, &status);
    assert_true(status.at_ns == clock.now_ns);
    assert_int_equal(stage_move_at(s, 1, 0.21), -EDOM);
    assert_int_equal(stage_move_at(s, 1, 0), -EDOM);
    assert_int_equal(stage_move_at(s, 1, (double)NAN), -EDOM);
    assert_int_equal(stage_move_at(s, 3, 0.1), -ERANGE);
    stage_close(s);
    s = open_stage("sim:?pace=fast", &clock);
    assert_int_equal(stage_move_at(s, 1, 0.1), -EDOM);
    stage_close(s);
    s = open_stage("none:", &clock);
    assert_int_equal(stage_move_at(s, 0, 0.1), -EDOM);
    stage_close(s);
}

/* 0.02 m never reach full speed: 0.2 s of acceleration to 0.1 m/s, 0.2 s of braking. */
static void a_short_move_is_a_triangle(void **state)
{
    struct fake_clock clock;
    struct stage *s =
        open_stage("sim:?speed=0.2&acceleration=0.5&settle=0&error=0", &clock);
    (void)state;
    assert_int_equal(stage_move(s, 0.02), 0);
    assert_at(s, &clock, 0.2, STAGE_MOVING, 0.01);
    assert_at(s, &clock, 0.399, STAGE_MOVING, 0.02 - 0.5 * 0.5 * 1e-6);
    assert_at(s, &clock, 0.401, STAGE_IDLE, 0.02);
    stage_close(s);
}

/* At 0.2 m/s a new target behind it: 0.04 m of braking to 0.14 m, then back to 0. */
static void a_new_target_replaces_the_move_without_a_jump(void **state)
{
    struct fake_clock clock;
    struct stage *s =
        open_stage("sim:?speed=0.2&acceleration=0.5&settle=0&error=0", &clock);
    (void)state;
    assert_int_equal(stage_move(s, 1), 0);
    clock.now_ns += INT64_C(700000000);
    assert_at(s, &clock, 0, STAGE_MOVING, 0.1);
    assert_int_equal(stage_move(s, 0), 0);
    assert_at(s, &clock, 0, STAGE_MOVING, 0.1);
    assert_at(s, &clock, 0.4, STAGE_MOVING, 0.14);
    assert_at(s, &clock, 0.8, STAGE_MOVING, 0.10);
    assert_at(s, &clock, 0.4 + 0.8 + 0.06 / 0.2 + 0.01, STAGE_IDLE, 0);
    stage_close(s);
}

static void fast_moves_take_no_time(void **state)
{
    struct fake_clock clock;
    struct stage *s = open_stage("sim:?pace=fast&error=0", &clock);
    (void)state;
    assert_int_equal(stage_move(s, 0.7), 0);
    assert_at(s, &clock, 0, STAGE_IDLE, 0.7);
    stage_close(s);
}

static void positions_err_by_the_rms_asked_for(void **state)
{
    struct fake_clock clock;
    struct stage *s = open_stage("sim:?pace=fast&error=0.0001", &clock);
    struct stage_status status;
    double sum = 0;
    (void)state;
    for (int i = 0; i < 400; i++) {
        double target_m = (i % 10) * 0.1;
        assert_int_equal(stage_move(s, target_m), 0);
        stage_status(s, &status);
        assert_true(status.target_m == target_m);
        sum += pow(status.position_m - target_m, 2);
    }
    assert_true(fabs(sqrt(sum / 400) / 1e-4 - 1) < 0.15);
    stage_close(s);
}

static void soft_limits_refuse_and_leave_the_stage_alone(void **state)
{
    struct fake_clock clock;
    struct stage *s = open_stage("sim:?pace=fast&error=0&min=0&max=0.5", &clock);
    (void)state;
    assert_int_equal(stage_move(s, 0.4), 0);
    assert_int_equal(stage_move(s, 0.6), -ERANGE);
    assert_int_equal(stage_move(s, -0.1), -ERANGE);
    assert_int_equal(stage_move(s, (double)NAN), -ERANGE);
    assert_at(s, &clock, 0, STAGE_IDLE, 0.4);
    stage_close(s);
}

/* What is named can be gone to: an end that is between two digits is not rounded out. */
static void a_refusal_says_how_far_it_goes(void **state)
{
    static const struct {
        double from_m, to_m;
        int err;
        const char *text;
    } cases[] = {
        {-0.05, 2.0, -ERANGE, "it does not reach that far: it goes from -0.05 to 2 m"},
        {0.00004, 0.97656, -ERANGE,
         "it does not reach that far: it goes from 0.0001 to 0.9765 m"},
        {0.0, 0.5, -ERANGE, "it does not reach that far: it goes from 0 to 0.5 m"},
        {0.0, 0.0, -ERANGE, "it does not reach that far: it stands at 0 m for good"},
        {0.0, 1.0, -ESTALE, "its place is not known, home it first"},
        {0.0, 1.0, -EDOM, "it does not go at that speed"},
    };
    char text[STAGE_TEXT_SIZE];

    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct stage_status s = {.reach_m = {cases[i].from_m, cases[i].to_m}};
        stage_refusal(&s, cases[i].err, text);
        assert_string_equal(text, cases[i].text);
    }
}

static void each_kind_says_how_far_it_goes(void **state)
{
    struct fake_clock clock;
    struct stage_status status;
    struct stage *s = open_stage("sim:?min=-0.1&max=0.5", &clock);

    (void)state;
    stage_status(s, &status);
    assert_true(status.reach_m[0] == -0.1 && status.reach_m[1] == 0.5);
    stage_close(s);
    s = open_stage("none:", &clock);
    stage_status(s, &status);
    assert_true(status.reach_m[0] == 0.0 && status.reach_m[1] == 0.0);
    stage_close(s);
}

/* 0.1 m/s after 0.2 s at 0.5 m/s2: 0.01 m gone, and as much to come to rest. */
static void a_stop_brakes_it_where_it_is(void **state)
{
    struct fake_clock clock;
    struct stage *s =
        open_stage("sim:?speed=0.2&acceleration=0.5&settle=0&error=0", &clock);
    (void)state;
    assert_int_equal(stage_move(s, 1), 0);
    clock.now_ns += INT64_C(200000000);
    assert_int_equal(stage_stop(s), 0);
    assert_at(s, &clock, 0, STAGE_MOVING, 0.01);
    assert_at(s, &clock, 0.21, STAGE_IDLE, 0.02);
    assert_int_equal(stage_home(s), 0);
    assert_at(s, &clock, 10, STAGE_IDLE, 0);
    stage_close(s);
}

static void a_fixed_array_stays_at_0(void **state)
{
    struct fake_clock clock;
    struct stage *s = open_stage("none:", &clock);
    (void)state;
    assert_int_equal(stage_move(s, 0), 0);
    assert_int_equal(stage_move(s, 0.1), -ERANGE);
    assert_at(s, &clock, 1, STAGE_IDLE, 0);
    stage_close(s);
}

static void devices_that_do_not_exist_are_named(void **state)
{
    static const struct {
        const char *uri;
        int err;
        const char *part;
    } cases[] = {
        {"stepper:/dev/ttyUSB0", -ENODEV, "stepper:/dev/ttyUSB0: no such kind of stage"},
        {"sim:?speed=-1", -EINVAL, "option speed=-1: expected a number in 0.0001..100"},
        {"sim:?speed=x", -EINVAL, "option speed=x: expected a number"},
        {"sim:?pace=slow", -EINVAL, "option pace=slow: expected real or fast"},
        {"sim:?velocity=1", -EINVAL, "no option \"velocity\""},
        {"sim:?speed", -EINVAL, "option \"speed\": expected key=value"},
        {"sim:?speed=1&speed=2", -EINVAL, "option \"speed\" is given twice"},
        {"sim:?min=1&max=0", -EINVAL, "min=1 is above max=0"},
        {"sim:there", -EINVAL, "expected only options"},
        {"gpiod:/dev/gpiochip0?direction=1", -EINVAL, "option step is missing"},
        {"gpiod:/dev/gpiochip0?step=1", -EINVAL, "option direction is missing"},
        {"gpiod:/dev/gpiochip0?step=1&direction=2", -EINVAL, "steps_per_m is missing"},
        {"gpiod:/dev/none?step=1&direction=2&steps_per_m=1000&max=1", -ENOENT,
         "there is no GPIO chip /dev/none"},
        {"gpiod:?step=1&direction=2&steps_per_m=1000&max=1", -EINVAL, "no chip is named"},
        {"gpiod:x?step=1&direction=2&steps_per_m=1000&max=1&invert=step,steep", -EINVAL,
         "option invert: \"steep\": expected step, direction"},
        {"gpiod:x?step=1&direction=2&steps_per_m=1000&max=1&pull=hard", -EINVAL,
         "option pull=hard: expected as-is, up or down"},
        {"gpiod:x?step=1&direction=2&steps_per_m=1000&max=1&homing=first-move", -EINVAL,
         "homing=first-move needs home=LINE"},
        {"gpiod:x?step=1&direction=2&steps_per_m=1e6&max=1&speed=1", -EINVAL,
         "1 m/s need 1000000 steps/s, more than pulses of 5 us allow"},
        {"gpiod:x?step=1&direction=2&steps_per_m=1000&max=1&backlash=0.01", -EINVAL,
         "backlash=0.01: expected less than back_off=0.005"},
        {"none:here", -EINVAL, "expected nothing after none:"},
    };
    struct fake_clock clock;
    (void)state;
    fake_clock_set(&clock, 0);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        struct stage *s;
        assert_int_equal(stage_open(&s, cases[i].uri, &clock.source, &why), cases[i].err);
        assert_null(s);
        assert_contains(why.text, cases[i].part);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_move_goes_as_fast_as_it_is_told),
        cmocka_unit_test(a_long_move_is_a_trapezoid),
        cmocka_unit_test(a_short_move_is_a_triangle),
        cmocka_unit_test(a_new_target_replaces_the_move_without_a_jump),
        cmocka_unit_test(fast_moves_take_no_time),
        cmocka_unit_test(positions_err_by_the_rms_asked_for),
        cmocka_unit_test(soft_limits_refuse_and_leave_the_stage_alone),
        cmocka_unit_test(a_refusal_says_how_far_it_goes),
        cmocka_unit_test(each_kind_says_how_far_it_goes),
        cmocka_unit_test(a_stop_brakes_it_where_it_is),
        cmocka_unit_test(a_fixed_array_stays_at_0),
        cmocka_unit_test(devices_that_do_not_exist_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
