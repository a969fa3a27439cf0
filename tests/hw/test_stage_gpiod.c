/* SPDX-License-Identifier: MIT */
/* The stage on the guest's simulated GPIO chip.  A step is 1 mm, the home switch closes
 * at 100 of the rail's own steps, the far one at 400; 0 of the axis is 5 steps above
 * home. */
#include <errno.h>
#include <math.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "gpio_rail.h"
#include "hal/stage.h"

#define LINES "step=sim0&direction=sim1&enable=sim2&home=sim3&limit=sim4&estop=sim5"
#define NUMBERS                                                                          \
    "&steps_per_m=1000&max=0.25&speed=0.1&acceleration=0.5&home_speed=0.1"               \
    "&pulse_us=4000&settle=0.02"
#define PULSE_US   4000
#define ZERO       105
#define DEADLINE_S 60

static int64_t now_ns(void)
{
    return clock_now_ns(clock_system());
}

static int try_open(struct stage **s, const char *chip, const char *options,
                    struct error *why)
{
    char uri[400];
    snprintf(uri, sizeof uri, "gpiod:%s?%s", chip, options);
    return stage_open(s, uri, clock_system(), why);
}

/* Closed when the test is over, also when it failed. */
struct bench {
    struct stage *stage;
    struct gpio_rail *rail;
};

static int setup(void **state)
{
    *state = calloc(1, sizeof(struct bench));
    return *state ? 0 : -1;
}

static int teardown(void **state)
{
    struct bench *b = *state;
    stage_close(b->stage);
    if (b->rail)
        gpio_rail_stop(b->rail);
    free(b);
    return 0;
}

static struct stage *open_named(void **state, const char *chip, const char *options)
{
    struct bench *b = *state;
    struct error why = {.text = ""};
    if (try_open(&b->stage, chip, options, &why))
        fail_msg("%s", why.text);
    return b->stage;
}

static struct stage *open_stage(void **state)
{
    return open_named(state, getenv("GUEST_GPIOCHIP"), LINES NUMBERS);
}

static void close_stage(void **state)
{
    struct bench *b = *state;
    stage_close(b->stage);
    b->stage = NULL;
}

static struct gpio_rail *start_rail(void **state, long position)
{
    struct bench *b = *state;
    b->rail = gpio_rail_start(position, 100, 400, PULSE_US, false);
    assert_non_null(b->rail);
    return b->rail;
}

static struct stage_status await(struct stage *s,
                                 bool (*done)(const struct stage_status *))
{
    struct stage_status status;
    int64_t end_ns = now_ns() + DEADLINE_S * INT64_C(1000000000);
    for (;;) {
        stage_status(s, &status);
        if (done(&status))
            return status;
        if (now_ns() > end_ns)
            fail_msg("motion %d at %g m for too long", status.motion, status.position_m);
        poll(NULL, 0, 2);
    }
}

static bool rests(const struct stage_status *s)
{
    return s->motion == STAGE_IDLE || s->motion == STAGE_FAULT;
}

static bool is_in_fault(const struct stage_status *s)
{
    return s->motion == STAGE_FAULT;
}

static void await_steps(struct gpio_rail *r, unsigned long n)
{
    int64_t end_ns = now_ns() + DEADLINE_S * INT64_C(1000000000);
    while (r->steps < n) {
        assert_true(now_ns() < end_ns);
        poll(NULL, 0, 1);
    }
}

static void assert_moved_to(struct stage *s, struct gpio_rail *r, double target_m)
{
    assert_int_equal(stage_move(s, target_m), 0);
    struct stage_status status = await(s, rests);
    if (status.motion != STAGE_IDLE)
        fail_msg("%s", status.text);
    assert_true(status.homed);
    assert_true(fabs(status.position_m - target_m) < 1e-9);
    assert_int_equal(r->position, ZERO + lround(1000 * target_m));
}

static uint64_t count(struct stage *s, const char *name)
{
    struct device_count counts[DEVICE_MAX_COUNTS];
    size_t n = stage_counts(s, counts);
    for (size_t i = 0; i < n; i++)
        if (!strcmp(counts[i].name, name))
            return counts[i].value;
    fail_msg("nothing counts %s", name);
    return 0;
}

static void assert_fault(struct stage *s, const char *part)
{
    struct stage_status status = await(s, is_in_fault);
    if (!strstr(status.text, part))
        fail_msg("it says: %s", status.text);
    assert_false(status.homed);
    assert_int_equal(stage_move(s, 0.1), -ESTALE);
}

static void assert_homed(struct stage *s, struct gpio_rail *r)
{
    assert_int_equal(stage_home(s), 0);
    struct stage_status status = await(s, rests);
    if (status.motion != STAGE_IDLE)
        fail_msg("%s", status.text);
    assert_int_equal(r->position, ZERO);
}

static void every_step_is_made_and_none_more(void **state)
{
    static const double targets_m[] = {0.1, 0.03, 0.031, 0.25, 0};
    struct gpio_rail *r = start_rail(state, 130);
    struct stage *s = open_stage(state);
    for (size_t i = 0; i < sizeof targets_m / sizeof *targets_m; i++)
        assert_moved_to(s, r, targets_m[i]);
    assert_int_equal(count(s, "homings"), 1); /* by the first move */
    assert_int_equal(count(s, "steps"), r->steps);
    assert_int_equal(r->unpowered, 0);
    close_stage(state);
    assert_false(gpio_rail_enabled(r));
}

static void a_limit_in_a_move_stops_it_within_one_step(void **state)
{
    struct gpio_rail *r = start_rail(state, 110);
    struct stage *s = open_stage(state);
    assert_homed(s, r);
    r->limit_at = 180;
    assert_int_equal(stage_move(s, 0.2), 0);
    assert_fault(s, "the far limit switch was hit");
    assert_in_range(r->position, 180, 181);
    assert_int_equal(count(s, "limit_hits"), 1);
    assert_homed(s, r);
    r->limit_at = 400;
    assert_moved_to(s, r, 0.2);
    r->home_at = 260; /* something closes it too early */
    assert_int_equal(stage_move(s, 0), 0);
    assert_fault(s, "the limit switch at home was hit");
    assert_in_range(r->position, 259, 305);
}

/* Over before the next step: only the edge tells of it. */
static void a_tap_on_the_emergency_stop_stops_it_within_one_step(void **state)
{
    struct gpio_rail *r = start_rail(state, 110);
    struct stage *s = open_stage(state);
    assert_homed(s, r);
    unsigned long tap = r->steps + 70;
    r->tap_at = tap;
    assert_int_equal(stage_move(s, 0.2), 0);
    assert_fault(s, "emergency stop");
    assert_in_range(r->steps, tap, tap + 1);
    assert_int_equal(count(s, "emergency_stops"), 1);
    assert_false(gpio_rail_enabled(r));
    assert_homed(s, r);
}

static void the_emergency_stop_bars_homing_while_it_is_pressed(void **state)
{
    struct gpio_rail *r = start_rail(state, 110);
    struct stage *s = open_stage(state);
    assert_homed(s, r);
    unsigned long steps = r->steps;
    gpio_rail_press(r, true); /* at rest */
    assert_fault(s, "emergency stop");
    assert_int_equal(stage_home(s), 0);
    assert_fault(s, "emergency stop");
    assert_int_equal(r->steps, steps);
    gpio_rail_press(r, false);
    assert_homed(s, r);
}

static void a_stop_brakes_and_keeps_the_place(void **state)
{
    struct gpio_rail *r = start_rail(state, 110);
    struct stage *s = open_stage(state);
    assert_homed(s, r);
    unsigned long begin = r->steps;
    assert_int_equal(stage_move(s, 0.25), 0);
    await_steps(r, begin + 40);
    assert_int_equal(stage_stop(s), 0);
    struct stage_status status = await(s, rests);
    assert_int_equal(status.motion, STAGE_IDLE);
    assert_true(status.homed);
    assert_in_range(r->position, ZERO + 41, ZERO + 240);
    assert_int_equal(r->position, ZERO + lround(1000 * status.position_m));
    assert_moved_to(s, r, 0.02);
}

static void lines_are_found_by_offset_and_the_chip_by_label(void **state)
{
    struct gpio_rail *r = start_rail(state, 110);
    struct stage *s = open_named(
        state, "anlos-sim", "step=0&direction=1&enable=2&home=3&limit=4&estop=5" NUMBERS);
    assert_moved_to(s, r, 0.01);
}

static void lines_may_be_active_low(void **state)
{
    struct bench *b = *state;
    b->rail = gpio_rail_start(110, 100, 400, PULSE_US, true);
    assert_non_null(b->rail);
    struct stage *s = open_named(state, getenv("GUEST_GPIOCHIP"),
                                 LINES NUMBERS "&invert=enable,home,limit,estop");
    assert_false(gpio_rail_enabled(b->rail));
    assert_moved_to(s, b->rail, 0.03);
    assert_int_equal(b->rail->unpowered, 0);
    b->rail->limit_at = 150;
    assert_int_equal(stage_move(s, 0.1), 0);
    assert_fault(s, "the far limit switch was hit");
}

/* An open switch reads as pressed then: this chip's lines go where they are pulled. */
static void switches_may_be_pulled_up(void **state)
{
    start_rail(state, 110);
    struct stage *s =
        open_named(state, getenv("GUEST_GPIOCHIP"), LINES NUMBERS "&pull=up");
    assert_int_equal(stage_home(s), 0);
    assert_fault(s, "emergency stop");
}

static void what_cannot_be_had_is_named(void **state)
{
    const char *chip = getenv("GUEST_GPIOCHIP");
    struct error why = {.text = ""};
    struct stage *other;
    open_stage(state);
    assert_int_equal(try_open(&other, chip, LINES NUMBERS, &why), -EBUSY);
    assert_non_null(strstr(why.text, "line sim0: used by anlos stage"));
    close_stage(state);
    assert_int_equal(try_open(&other, chip, "step=sim0&direction=left" NUMBERS, &why),
                     -ENOENT);
    assert_non_null(strstr(why.text, "has no line left"));
    assert_int_equal(try_open(&other, chip, "step=99&direction=1" NUMBERS, &why),
                     -ENOENT);
    assert_non_null(strstr(why.text, "has no line 99"));
}

static void as_root_there_is_nothing_to_note(void **state)
{
    struct stage *s = open_stage(state);
    struct stage_status status;
    stage_status(s, &status);
    assert_string_equal(status.note, "");
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    const struct CMUnitTest tests[] = {
        TEST(every_step_is_made_and_none_more),
        TEST(a_limit_in_a_move_stops_it_within_one_step),
        TEST(a_tap_on_the_emergency_stop_stops_it_within_one_step),
        TEST(the_emergency_stop_bars_homing_while_it_is_pressed),
        TEST(a_stop_brakes_and_keeps_the_place),
        TEST(lines_are_found_by_offset_and_the_chip_by_label),
        TEST(lines_may_be_active_low),
        TEST(switches_may_be_pulled_up),
        TEST(what_cannot_be_had_is_named),
        TEST(as_root_there_is_nothing_to_note),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
