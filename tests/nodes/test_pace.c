/* SPDX-License-Identifier: MIT */
#include "nodes/rt/health.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

static void a_tenth_skipped_is_a_moments_load_and_more_is_late(void **state)
{
    struct pace p = {.done = 90, .skipped = 10};

    (void)state;
    assert_false(pace_is_late(&p, 5));
    p.done += 89;
    p.skipped += 11;
    assert_false(pace_is_late(&p, 4 + PACE_LOOK_NS)); /* it is not time to look yet */
    assert_true(pace_is_late(&p, 5 + PACE_LOOK_NS));
}

static void it_is_judged_by_what_came_since_the_last_look(void **state)
{
    struct pace p = {.done = 1, .skipped = 1000};

    (void)state;
    assert_true(pace_is_late(&p, 0));
    assert_true(pace_is_late(&p, PACE_LOOK_NS - 1));
    p.done += 42;
    assert_false(pace_is_late(&p, PACE_LOOK_NS));
    assert_false(pace_is_late(&p, 2 * PACE_LOOK_NS)); /* nothing came at all */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tenth_skipped_is_a_moments_load_and_more_is_late),
        cmocka_unit_test(it_is_judged_by_what_came_since_the_last_look),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
