/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <time.h>

#include <cmocka.h>

#include "hal/clock.h"
#include "tests/hal/scratch.h"

static int64_t wall_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_REALTIME, &t);
    return (int64_t)t.tv_sec * INT64_C(1000000000) + t.tv_nsec;
}

static void it_shows_wall_time(void **state)
{
    (void)state;
    int64_t before = wall_ns(), now = clock_now_ns(clock_system()), after = wall_ns();
    assert_true(now > before - 50000000 && now < after + 50000000);
}

static void it_never_runs_backwards(void **state)
{
    const struct clock_source *c = clock_system();
    int64_t last = clock_now_ns(c);
    (void)state;
    for (int i = 0; i < 10000; i++) {
        int64_t now = clock_now_ns(c);
        assert_true(now >= last);
        last = now;
    }
}

static void a_sleep_ends_at_its_time_and_not_before(void **state)
{
    const struct clock_source *c = clock_system();
    int64_t until = clock_now_ns(c) + 2000000;
    (void)state;
    assert_int_equal(c->sleep_until_ns(c->state, until), 0);
    assert_true(clock_now_ns(c) >= until);
}

static void a_time_that_has_passed_does_not_sleep(void **state)
{
    const struct clock_source *c = clock_system();
    (void)state;
    assert_int_equal(c->sleep_until_ns(c->state, clock_now_ns(c) - 1), 0);
    assert_int_equal(c->sleep_until_ns(c->state, 0), 0);
}

/* -- the time of a replay --------------------------------------------------------------
 */

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
        cmocka_unit_test(it_shows_wall_time),
        cmocka_unit_test(it_never_runs_backwards),
        cmocka_unit_test(a_sleep_ends_at_its_time_and_not_before),
        cmocka_unit_test(a_time_that_has_passed_does_not_sleep),
        cmocka_unit_test(until_something_is_replayed_it_is_the_machine_s_time),
        cmocka_unit_test(a_replay_s_time_stands_still_and_goes_back_when_it_is_told),
        cmocka_unit_test(a_sleep_lasts_as_long_as_it_would_and_moves_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
