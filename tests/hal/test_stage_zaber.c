/* SPDX-License-Identifier: MIT */
/* Against a simulated device on a pseudo terminal.  25.4 mm a turn, 200 x 64 microsteps:
 * 1.984375 um each; 500000 of them are 0.9921875 m. */
#include "scratch.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <time.h>

#include "hal/stage.h"
#include "zaber_device.h"

#define STEP_M 1.984375e-6

static int64_t real_now(void *state)
{
    struct timespec t;
    (void)state;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static const struct clock_source real = {.now_ns = real_now};

static int try_open(struct stage **s, const struct zaber_device *d, const char *options,
                    struct error *why)
{
    char uri[200];
    snprintf(uri, sizeof uri, "zaber:%s?pitch_mm=25.4&settle=0%s", d->path, options);
    return stage_open(s, uri, &real, why);
}

static struct stage *open_stage(const struct zaber_device *d, const char *options)
{
    struct error why = {.text = ""};
    struct stage *s;
    if (try_open(&s, d, options, &why))
        fail_msg("%s", why.text);
    return s;
}

#define DEADLINE_NS INT64_C(8000000000)

static void await_position(const struct zaber_device *d, long least)
{
    int64_t end_ns = real_now(NULL) + DEADLINE_NS;
    while (d->position < least) {
        if (real_now(NULL) > end_ns)
            fail_msg("it stands at %ld and goes no further", (long)d->position);
        poll(NULL, 0, 2);
    }
}

/* From where a device stands when it is started, either way. */
static void await_departure(const struct zaber_device *d)
{
    int64_t end_ns = real_now(NULL) + DEADLINE_NS;
    while (d->position == 70000) {
        if (real_now(NULL) > end_ns)
            fail_msg("it does not leave its place");
        poll(NULL, 0, 2);
    }
}

static void await_motion_at_least(const struct zaber_device *d, long position)
{
    int64_t end_ns = real_now(NULL) + DEADLINE_NS;
    while (d->position < position) {
        if (real_now(NULL) > end_ns)
            fail_msg("it does not get to %ld", position);
        poll(NULL, 0, 2);
    }
}

/* It reads what was sent to it, however late. */
static void await_commands(const struct zaber_device *d, int least)
{
    int64_t end_ns = real_now(NULL) + DEADLINE_NS;
    while (d->commands < least) {
        if (real_now(NULL) > end_ns)
            fail_msg("%d commands came, not %d", d->commands, least);
        poll(NULL, 0, 2);
    }
}

static void await_stop(const struct zaber_device *d)
{
    int64_t end_ns = real_now(NULL) + DEADLINE_NS;
    while (!d->stops) {
        if (real_now(NULL) > end_ns)
            fail_msg("it was not told to stop");
        poll(NULL, 0, 2);
    }
}

/* Until it no longer moves. */
static struct stage_status await_rest(struct stage *s)
{
    struct stage_status status;
    int64_t end_ns = real_now(NULL) + DEADLINE_NS;
    do {
        stage_status(s, &status);
        if (status.motion != STAGE_MOVING)
            return status;
        poll(NULL, 0, 2);
    } while (real_now(NULL) < end_ns);
    fail_msg("it still moves");
    return status;
}

static void assert_idle_at(struct stage *s, double position_m)
{
    struct stage_status status = await_rest(s);
    if (status.motion != STAGE_IDLE)
        fail_msg("motion %d: %s", status.motion, status.text);
    assert_true(fabs(status.position_m - position_m) <= STEP_M);
    assert_true(status.homed);
}

static void assert_fault(struct stage *s, const char *part)
{
    struct stage_status status;
    int64_t end_ns = real_now(NULL) + DEADLINE_NS;
    do {
        stage_status(s, &status);
        poll(NULL, 0, 2);
    } while (status.motion != STAGE_FAULT && real_now(NULL) < end_ns);
    assert_int_equal(status.motion, STAGE_FAULT);
    assert_contains(status.text, part);
    assert_false(status.homed);
    assert_int_equal(stage_move(s, 0.1), -ESTALE);
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

static void finish(struct stage *s, struct zaber_device *d)
{
    stage_close(s);
    zaber_device_unplug(d);
    free(d);
}

static void the_first_move_homes_and_lengths_become_microsteps(void **state)
{
    struct zaber_device *d = zaber_device_start(false);
    struct stage *s = open_stage(d, "");
    (void)state;
    assert_int_equal(stage_move(s, 0.1), 0);
    assert_idle_at(s, 0.1);
    assert_int_equal(d->homings, 1);
    assert_int_equal(d->position, 50394); /* 0.1 / 1.984375e-6 = 50393.7 */
    assert_int_equal(stage_move(s, 0.05), 0);
    assert_idle_at(s, 0.05);
    assert_int_equal(d->position, 25197);
    assert_int_equal(count(s, "homings"), 1);
    assert_int_equal(count(s, "retries"), 0);
    finish(s, d);
}

static void a_device_that_knows_its_place_is_not_homed(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    struct stage_status status;
    (void)state;
    stage_status(s, &status);
    assert_true(status.homed);
    assert_true(fabs(status.position_m - 70000 * STEP_M) < 1e-9);
    assert_int_equal(stage_move(s, 0.2), 0);
    assert_idle_at(s, 0.2);
    assert_int_equal(d->homings, 0);
    finish(s, d);
}

/* 0.05 m/s are 25197 microsteps/s; what the device had is set again, also when a newer
 * command ends the move.  Where it was is told as of when it looked. */
static void a_move_goes_as_fast_as_it_is_told(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    struct stage_status status;
    (void)state;
    assert_int_equal(stage_move_at(s, 0.145, 0.05), 0);
    await_motion_at_least(d, 70001);
    assert_int_equal(d->speed, 25197);
    int64_t before_ns = real_now(NULL);
    do
        stage_status(s, &status);
    while (status.at_ns < before_ns && status.motion == STAGE_MOVING);
    assert_true(status.at_ns <= real_now(NULL));
    assert_idle_at(s, 0.145);
    assert_int_equal(d->speed, 400000);
    assert_int_equal(stage_move_at(s, 0.9, 0.05), 0);
    await_motion_at_least(d, 73100);
    assert_int_equal(stage_move(s, 0.2), 0);
    assert_idle_at(s, 0.2);
    assert_int_equal(d->speed, 400000);
    assert_int_equal(stage_move_at(s, 0.1, 0.8), -EDOM); /* its own: 0.79375 */
    finish(s, d);
}

/* What a process that is killed leaves behind: a low speed, which the device keeps, and a
 * move that goes on. */
static struct zaber_device *leave_moving(void)
{
    struct zaber_device *d = zaber_device_start(true);

    d->speed = 25197; /* microsteps/s: 0.05 m/s */
    d->target = 400000;
    await_motion_at_least(d, 70000);
    return d;
}

static void a_speed_that_is_named_is_set_again_after_a_kill(void **state)
{
    struct zaber_device *d = leave_moving();
    struct stage *s = open_stage(d, "&speed=0.79375"); /* 400000 microsteps/s */
    struct stage_status status;

    (void)state;
    assert_int_equal(d->speed, 400000);
    assert_int_equal(d->stops, 1);
    assert_true(d->position < 400000);
    stage_status(s, &status);
    assert_int_equal(status.motion, STAGE_IDLE); /* where it was stopped */
    assert_true(status.homed);
    assert_string_equal(status.note, "");
    assert_int_equal(stage_move_at(s, 0.3, 0.79), 0);
    assert_idle_at(s, 0.3);
    assert_int_equal(d->speed, 400000);
    assert_int_equal(d->homings, 0);
    finish(s, d);
}

static void a_speed_that_may_be_of_a_killed_process_is_told(void **state)
{
    struct zaber_device *d = leave_moving();
    struct stage *s = open_stage(d, "");
    struct stage_status status;

    (void)state;
    stage_status(s, &status);
    assert_contains(status.note, "0.0500 m/s may be the speed of that run");
    assert_true(status.homed);
    assert_int_equal(d->stops, 1);
    assert_int_equal(d->speed, 25197);
    finish(s, d);
}

static void a_speed_that_the_device_has_is_left_alone(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    struct stage_status status;

    (void)state;
    stage_status(s, &status);
    assert_string_equal(status.note, "");
    assert_int_equal(d->stops, 0);
    assert_int_equal(d->speed, 400000);
    finish(s, d);
}

static void with_manual_homing_it_waits_for_it(void **state)
{
    struct zaber_device *d = zaber_device_start(false);
    struct stage *s = open_stage(d, "&homing=manual");
    (void)state;
    assert_fault(s, "its place is not known: home it");
    assert_int_equal(stage_home(s), 0);
    assert_idle_at(s, 0);
    assert_int_equal(stage_move(s, 0.02), 0);
    assert_idle_at(s, 0.02);
    finish(s, d);
}

static void it_reaches_as_far_as_the_device_and_the_options_say(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "&min=0.01");
    (void)state;
    assert_int_equal(stage_move(s, 0.9922), -ERANGE); /* limit.max: 0.9921875 */
    assert_int_equal(stage_move(s, 0.9921), 0);
    assert_int_equal(stage_move(s, 0.009), -ERANGE);
    finish(s, d);
}

/* Each trick for two answers, in the middle of moves: the third try gets through. */
static void answers_that_stay_away_or_are_garbled_are_asked_for_again(void **state)
{
    static const struct {
        enum zaber_trick trick;
        const char *count;
        uint64_t retries;
    } cases[] = {
        {TRICK_SILENCE, NULL, 2},        {TRICK_GARBAGE, "garbled_lines", 0},
        {TRICK_HALF, NULL, 2},           {TRICK_CHECKSUM, "checksum_errors", 2},
        {TRICK_LATE, "late_answers", 2}, {TRICK_ENDLESS, "garbled_lines", 0},
        {TRICK_STRANGER, NULL, 0},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct zaber_device *d = zaber_device_start(true);
        d->checksums = cases[i].trick == TRICK_CHECKSUM;
        struct stage *s = open_stage(d, "&timeout=0.5"); /* of a busy machine */
        d->trick = cases[i].trick;
        d->times = 2;
        assert_int_equal(stage_move(s, 0.1), 0);
        assert_idle_at(s, 0.1);
        assert_int_equal(d->position, 50394);
        assert_int_equal(d->times, 0);
        assert_true(count(s, "retries") >= cases[i].retries);
        if (cases[i].count)
            assert_true(count(s, cases[i].count) >= 2);
        assert_int_equal(d->wrong, 0);
        finish(s, d);
    }
}

static void a_device_that_never_answers_is_named(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct error why = {.text = ""};
    struct stage *s;
    (void)state;
    d->trick = TRICK_SILENCE;
    d->times = 1000;
    assert_int_equal(try_open(&s, d, "&timeout=0.02", &why), -ETIMEDOUT);
    assert_contains(why.text, "it does not answer");
    await_commands(d, 3);
    assert_int_equal(d->commands, 3);
    zaber_device_unplug(d);
    free(d);
}

static void silence_in_a_move_is_a_fault_and_it_is_told_to_stop(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "&timeout=0.3");
    (void)state;
    d->speed = 40000;
    assert_int_equal(stage_move(s, 0.5), 0);
    await_departure(d);
    d->trick = TRICK_SILENCE;
    d->times = 4; /* three questions, and the stop */
    assert_fault(s, "it does not answer");
    await_stop(d);
    d->speed = 400000;
    assert_int_equal(stage_home(s), 0);
    assert_idle_at(s, 0);
    finish(s, d);
}

static void a_fault_on_a_slow_move_leaves_it_no_slower(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    d->stall_at = 75000;
    assert_int_equal(stage_move_at(s, 0.4, 0.05), 0);
    assert_fault(s, "stalled and stopped (FS)");
    d->stall_at = 0;
    assert_int_equal(stage_home(s), 0);
    assert_idle_at(s, 0);
    assert_int_equal(d->speed, 400000);
    finish(s, d);
}

static void a_stall_is_a_fault_until_it_is_homed(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    d->stall_at = 100000;
    assert_int_equal(stage_move(s, 0.4), 0);
    assert_fault(s, "stalled and stopped (FS)");
    d->stall_at = 0;
    assert_int_equal(stage_home(s), 0);
    assert_idle_at(s, 0);
    assert_int_equal(stage_move(s, 0.4), 0);
    assert_idle_at(s, 0.4);
    finish(s, d);
}

static void a_warning_is_noted_and_counted_once_and_moves_go_on(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    struct stage_status status;
    (void)state;
    d->hot = true;
    assert_int_equal(stage_move(s, 0.3), 0);
    assert_idle_at(s, 0.3);
    stage_status(s, &status);
    assert_string_equal(status.note, "its controller is hot (WT)");
    assert_int_equal(count(s, "warnings"), 1);
    d->hot = false;
    assert_int_equal(stage_move(s, 0.1), 0);
    assert_idle_at(s, 0.1);
    stage_status(s, &status);
    assert_string_equal(status.note, "");
    finish(s, d);
}

static void a_restart_in_a_move_loses_the_place(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    d->reboot_at = 120000;
    assert_int_equal(stage_move(s, 0.4), 0);
    assert_fault(s, "it lost its place: has no reference position (WR)");
    assert_int_equal(stage_home(s), 0);
    assert_idle_at(s, 0);
    finish(s, d);
}

static void a_homing_that_finds_nothing_is_a_fault(void **state)
{
    struct zaber_device *d = zaber_device_start(false);
    struct stage *s = open_stage(d, "");
    (void)state;
    d->homeless = true;
    assert_int_equal(stage_move(s, 0.4), 0);
    assert_fault(s, "no reference position");
    finish(s, d);
}

static void a_stage_that_ends_elsewhere_has_not_arrived(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    d->blocked_at = 150000;
    assert_int_equal(stage_move(s, 0.4), 0);
    assert_fault(s, "stands at 0.2977 m instead of 0.4000 m");
    finish(s, d);
}

static void one_that_is_moved_at_rest_is_noticed(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    zaber_device_shift(d, 5000);
    assert_fault(s, "was moved");
    finish(s, d);
}

static void the_newest_target_counts(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    assert_int_equal(stage_move(s, 0.9), 0);
    await_departure(d);
    assert_int_equal(stage_move(s, 0.03), 0);
    assert_idle_at(s, 0.03);
    assert_int_equal(d->stops, 1);
    finish(s, d);
}

static void a_stop_keeps_the_place(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    struct stage_status status;
    (void)state;
    d->speed = 100000;
    assert_int_equal(stage_move(s, 0.9), 0);
    await_position(d, 75000);
    assert_int_equal(stage_stop(s), 0);
    status = await_rest(s);
    assert_int_equal(status.motion, STAGE_IDLE);
    assert_true(status.homed);
    assert_true(status.position_m > 75000 * STEP_M && status.position_m < 0.89);
    assert_true(status.target_m == status.position_m);
    d->speed = 400000;
    assert_int_equal(stage_move(s, 0.1), 0);
    assert_idle_at(s, 0.1);
    finish(s, d);
}

static void a_homing_that_is_stopped_leaves_no_place(void **state)
{
    struct zaber_device *d = zaber_device_start(false);
    struct stage *s = open_stage(d, "");
    (void)state;
    d->speed = 10000;
    assert_int_equal(stage_home(s), 0);
    await_departure(d);
    assert_int_equal(stage_stop(s), 0);
    assert_fault(s, "homing was stopped");
    finish(s, d);
}

static void closing_stops_it(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    d->speed = 10000;
    assert_int_equal(stage_move(s, 0.9), 0);
    await_departure(d);
    stage_close(s);
    await_stop(d);
    assert_true(d->target == d->position && d->position < 200000);
    zaber_device_unplug(d);
    free(d);
}

static void an_adapter_that_is_pulled_out_is_a_fault(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct stage *s = open_stage(d, "");
    (void)state;
    zaber_device_unplug(d);
    assert_int_equal(stage_move(s, 0.3), 0);
    assert_fault(s, "its serial port is gone");
    stage_close(s);
    free(d);
}

static void checksums_are_sent_once_the_device_sends_them(void **state)
{
    struct zaber_device *d = zaber_device_start(true);
    struct error why = {.text = ""};
    struct stage *s;
    (void)state;
    d->checksums = true;
    s = open_stage(d, "");
    assert_int_equal(d->checked, d->commands - 1);
    stage_close(s);
    await_stop(d); /* its last word */
    d->checked = d->commands = 0;
    s = open_stage(d, "&checksum=off");
    assert_int_equal(d->checked, 0);
    stage_close(s);
    d->checksums = false;
    assert_int_equal(try_open(&s, d, "&checksum=on&timeout=0.02", &why), -ETIMEDOUT);
    assert_int_equal(d->wrong, 0);
    zaber_device_unplug(d);
    free(d);
}

static void wrong_options_are_named(void **state)
{
    static const struct {
        const char *uri;
        int err;
        const char *part;
    } cases[] = {
        {"zaber:?pitch_mm=1", -EINVAL, "no serial port is named"},
        {"zaber:/dev/null", -EINVAL, "option pitch_mm is missing"},
        {"zaber:/dev/null?pitch_mm=1", -ENOTTY, "/dev/null: is no serial port"},
        {"zaber:/dev/none?pitch_mm=1", -ENOENT, "/dev/none: No such file"},
        {"zaber:/dev/null?pitch_mm=1&baud=12000", -EINVAL, "12000 baud: expected 9600"},
        {"zaber:/dev/null?pitch_mm=1&min=2&max=1", -EINVAL, "min=2 is not under max=1"},
        {"zaber:/dev/null?pitch_mm=1&checksum=maybe", -EINVAL,
         "expected auto, on or off"},
        {"zaber:/dev/null?pitch=1", -EINVAL, "there is no option \"pitch\""},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct error why = {.text = ""};
        struct stage *s;
        assert_int_equal(stage_open(&s, cases[i].uri, &real, &why), cases[i].err);
        assert_contains(why.text, cases[i].part);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_first_move_homes_and_lengths_become_microsteps),
        cmocka_unit_test(a_device_that_knows_its_place_is_not_homed),
        cmocka_unit_test(a_move_goes_as_fast_as_it_is_told),
        cmocka_unit_test(a_speed_that_is_named_is_set_again_after_a_kill),
        cmocka_unit_test(a_speed_that_may_be_of_a_killed_process_is_told),
        cmocka_unit_test(a_speed_that_the_device_has_is_left_alone),
        cmocka_unit_test(with_manual_homing_it_waits_for_it),
        cmocka_unit_test(it_reaches_as_far_as_the_device_and_the_options_say),
        cmocka_unit_test(answers_that_stay_away_or_are_garbled_are_asked_for_again),
        cmocka_unit_test(a_device_that_never_answers_is_named),
        cmocka_unit_test(silence_in_a_move_is_a_fault_and_it_is_told_to_stop),
        cmocka_unit_test(a_fault_on_a_slow_move_leaves_it_no_slower),
        cmocka_unit_test(a_stall_is_a_fault_until_it_is_homed),
        cmocka_unit_test(a_warning_is_noted_and_counted_once_and_moves_go_on),
        cmocka_unit_test(a_restart_in_a_move_loses_the_place),
        cmocka_unit_test(a_homing_that_finds_nothing_is_a_fault),
        cmocka_unit_test(a_stage_that_ends_elsewhere_has_not_arrived),
        cmocka_unit_test(one_that_is_moved_at_rest_is_noticed),
        cmocka_unit_test(the_newest_target_counts),
        cmocka_unit_test(a_stop_keeps_the_place),
        cmocka_unit_test(a_homing_that_is_stopped_leaves_no_place),
        cmocka_unit_test(closing_stops_it),
        cmocka_unit_test(an_adapter_that_is_pulled_out_is_a_fault),
        cmocka_unit_test(checksums_are_sent_once_the_device_sends_them),
        cmocka_unit_test(wrong_options_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
