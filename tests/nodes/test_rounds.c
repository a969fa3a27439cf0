/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/scan/fixed_scan.h"

#define MS 1000000LL

static void what_is_missing_in_the_sequence_is_lost(void **state)
{
    struct rounds r = {0};

    (void)state;
    rounds_start(&r, 3);
    rounds_add(&r, 1, 0, true, 0);
    rounds_add(&r, 1, 2, true, 1); /* 1 is missing */
    assert_int_equal(r.all_lost, 1);
    assert_int_equal(rounds_frames(&r), 1);
    rounds_add(&r, 3, 1, true, 2); /* the second round, and the third's first */
    assert_int_equal(r.all_lost, 5);
    assert_int_equal(r.all_done, 3);
    assert_int_equal(rounds_frames(&r), 2);
}

static void a_ping_that_is_void_is_lost_and_said_to_be(void **state)
{
    struct rounds r = {0};
    char text[80];

    (void)state;
    rounds_start(&r, 2);
    rounds_add(&r, 1, 0, false, 0);
    rounds_add(&r, 1, 1, true, 100 * MS);
    assert_int_equal(r.all_lost, 1);
    assert_int_equal(r.all_done, 1);
    rounds_text(&r, 100 * MS, text, sizeof text);
    assert_string_equal(text, "5.0 frames/s, 10.0 pings/s; 1 void");
}

static void a_ping_that_comes_twice_or_late_does_not_count(void **state)
{
    struct rounds r = {0};

    (void)state;
    rounds_start(&r, 2);
    rounds_add(&r, 2, 1, true, 0);
    rounds_add(&r, 2, 1, true, 1);
    rounds_add(&r, 1, 0, true, 2);
    assert_int_equal(r.all_done, 1);
    assert_int_equal(r.all_lost, 3);
}

static void a_new_start_counts_from_the_first_round_and_keeps_the_sums(void **state)
{
    struct rounds r = {0};

    (void)state;
    rounds_start(&r, 2);
    rounds_add(&r, 1, 1, true, 0);
    rounds_start(&r, 2);
    assert_int_equal(rounds_frames(&r), 0);
    rounds_add(&r, 1, 0, true, 1);
    assert_int_equal(r.all_done, 2);
    assert_int_equal(r.all_lost, 1);
}

static void the_pace_is_that_of_the_newest_and_stops_with_them(void **state)
{
    struct rounds r = {0};
    char text[80];

    (void)state;
    rounds_start(&r, 4);
    rounds_text(&r, 0, text, sizeof text);
    assert_string_equal(text, "waits for the first ping");
    for (uint32_t i = 0; i < 1000; i++) /* slow, then 25 ms each */
        rounds_add(&r, i / 4 + 1, i % 4, true,
                   (i < 800 ? 100 * i : 80000 + 25 * (i - 800)) * MS);
    rounds_text(&r, 85000 * MS, text, sizeof text);
    assert_string_equal(text, "10.0 frames/s, 40.0 pings/s");
    rounds_text(&r, 88000 * MS, text, sizeof text);
    assert_string_equal(text, "0.0 frames/s, 0.0 pings/s");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_missing_in_the_sequence_is_lost),
        cmocka_unit_test(a_ping_that_is_void_is_lost_and_said_to_be),
        cmocka_unit_test(a_ping_that_comes_twice_or_late_does_not_count),
        cmocka_unit_test(a_new_start_counts_from_the_first_round_and_keeps_the_sums),
        cmocka_unit_test(the_pace_is_that_of_the_newest_and_stops_with_them),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
