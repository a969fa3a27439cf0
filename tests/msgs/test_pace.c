/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "msgs/publisher.h"

#define SECOND INT64_C(1000000000)

static struct pace example(void)
{
    return (struct pace){.rate_bytes_s = 100, .burst_bytes = 50};
}

static void what_fits_the_burst_starts_at_once(void **state)
{
    (void)state;
    struct pace p = example();
    assert_int_equal(pace_delay_ns(&p, 5 * SECOND), 0);
    pace_spend(&p, 5 * SECOND, 50);
    assert_int_equal(pace_delay_ns(&p, 5 * SECOND), 0);
}

/* 250 bytes under way, 50 allowed: 200 bytes at 100 a second. */
static void the_message_behind_a_large_one_waits_for_it(void **state)
{
    (void)state;
    struct pace p = example();
    pace_spend(&p, 0, 250);
    assert_int_equal(pace_delay_ns(&p, 0), 2 * SECOND);
    assert_int_equal(pace_delay_ns(&p, SECOND), SECOND);
    assert_int_equal(pace_delay_ns(&p, 2 * SECOND), 0);
}

static void what_was_not_used_is_not_saved_up(void **state)
{
    (void)state;
    struct pace p = example();
    pace_spend(&p, 0, 1);
    pace_spend(&p, 1000 * SECOND, 150);
    assert_int_equal(pace_delay_ns(&p, 1000 * SECOND), SECOND);
}

static void a_long_stream_keeps_to_the_rate(void **state)
{
    (void)state;
    struct pace p = example();
    int64_t now_ns = 0;
    for (int i = 0; i < 1000; i++) {
        now_ns += pace_delay_ns(&p, now_ns);
        pace_spend(&p, now_ns, 30);
    }
    /* The last one starts when 999 * 30 bytes but the burst have gone. */
    assert_in_range(now_ns, (999 * 30 - 50) * SECOND / 100,
                    (999 * 30 - 50) * SECOND / 100 + 1000);
}

static void a_clock_that_steps_back_does_no_harm(void **state)
{
    (void)state;
    struct pace p = example();
    pace_spend(&p, 10 * SECOND, 100);
    assert_int_equal(pace_delay_ns(&p, 0), SECOND / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_fits_the_burst_starts_at_once),
        cmocka_unit_test(the_message_behind_a_large_one_waits_for_it),
        cmocka_unit_test(what_was_not_used_is_not_saved_up),
        cmocka_unit_test(a_long_stream_keeps_to_the_rate),
        cmocka_unit_test(a_clock_that_steps_back_does_no_harm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
