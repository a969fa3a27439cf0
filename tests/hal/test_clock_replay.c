/* SPDX-License-Identifier: MIT */
#include "tests/hal/scratch.h"

#include "hal/clock_replay.h"

static void until_something_is_replayed_it_is_the_machine_s_time(void **state)
{
    struct fake_clock machine;
    struct clock_replay c;

    (void)state;
    fake_clock_set(&machine, 1000);
    clock_replay_init(&c, &machine.source);
    assert_true(clock_now_ns(&c.source) == 1000);
    machine.now_ns = 2000;
    assert_true(clock_now_ns(&c.source) == 2000);
}

static void a_replay_s_time_stands_still_and_goes_back_when_it_is_told(void **state)
{
    struct fake_clock machine;
    struct clock_replay c;

    (void)state;
    fake_clock_set(&machine, 1000);
    clock_replay_init(&c, &machine.source);
    clock_replay_set(&c, 70);
    machine.now_ns = 5000;
    assert_true(clock_now_ns(&c.source) == 70);
    clock_replay_set(&c, 50);
    assert_true(clock_now_ns(&c.source) == 50);
    clock_replay_end(&c);
    assert_true(clock_now_ns(&c.source) == 5000);
}

static void a_sleep_lasts_as_long_as_it_would_and_moves_nothing(void **state)
{
    struct fake_clock machine;
    struct clock_replay c;

    (void)state;
    fake_clock_set(&machine, 1000);
    clock_replay_init(&c, &machine.source);
    clock_replay_set(&c, 70);
    assert_int_equal(c.source.sleep_until_ns(c.source.state, 100), 0);
    assert_true(machine.now_ns == 1030);
    assert_true(clock_now_ns(&c.source) == 70);
    assert_int_equal(c.source.sleep_until_ns(c.source.state, 60), 0); /* it is over */
    assert_true(machine.now_ns == 1030);
    machine.interrupted = 1;
    assert_int_equal(c.source.sleep_until_ns(c.source.state, 100), -4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(until_something_is_replayed_it_is_the_machine_s_time),
        cmocka_unit_test(a_replay_s_time_stands_still_and_goes_back_when_it_is_told),
        cmocka_unit_test(a_sleep_lasts_as_long_as_it_would_and_moves_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
