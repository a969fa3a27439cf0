/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "nodes/rt/stage_line.h"

#define MS    1000000LL
#define START INT64_C(1795393947000000000)

static void between_reports_a_stage_goes_straight_on(void **state)
{
    struct stage_line l = {.n = 0};
    struct stage_line_fit f;
    (void)state;
    for (int k = 0; k < 10; k++)
        stage_line_add(&l, START + 50 * k * MS, 0.1 - 0.06 * 0.05 * k);
    assert_true(stage_line_fit(&l, START, START + 1000 * MS, &f));
    assert_int_equal(f.n, 10);
    assert_true(fabs(f.speed_m_s + 0.06) < 1e-9);
    assert_true(f.jitter_m < 1e-9);
    assert_true(fabs(stage_line_place_m(&f, START + 777 * MS) - (0.1 - 0.06 * 0.777)) <
                1e-9);
    assert_true(llabs(stage_line_time_ns(&f, 0.04) - (START + 1000 * MS)) < 1000);
}

/* Every second report is 0.1 mm ahead, the others 0.1 mm behind. */
static void many_reports_are_better_than_one(void **state)
{
    struct stage_line l = {.n = 0};
    struct stage_line_fit f;
    (void)state;
    for (int k = 0; k < 20; k++)
        stage_line_add(&l, START + 50 * k * MS, 0.06 * 0.05 * k + (k % 2 ? 1e-4 : -1e-4));
    assert_true(stage_line_fit(&l, START, START + 1000 * MS, &f));
    assert_true(fabs(f.jitter_m - 1e-4) < 1e-5);
    assert_true(fabs(stage_line_place_m(&f, START + 475 * MS) - 0.06 * 0.475) < 1e-5);
}

static void only_reports_of_the_span_count_and_three_are_needed(void **state)
{
    struct stage_line l = {.n = 0};
    struct stage_line_fit f;
    (void)state;
    for (int k = 0; k < 8; k++) /* it rests, then goes */
        stage_line_add(&l, START + 50 * k * MS, k < 4 ? 0 : 0.003 * (k - 4));
    assert_true(stage_line_fit(&l, START + 200 * MS, START + 400 * MS, &f));
    assert_int_equal(f.n, 4);
    assert_true(f.jitter_m < 1e-8 && fabs(f.speed_m_s - 0.06) < 1e-9);
    assert_false(stage_line_fit(&l, START + 290 * MS, START + 400 * MS, &f));
    assert_false(stage_line_fit(&l, START + 1000 * MS, START + 2000 * MS, &f));
}

static void what_is_reported_again_or_late_is_ignored(void **state)
{
    struct stage_line l = {.n = 0};
    (void)state;
    stage_line_add(&l, START, 0.1);
    stage_line_add(&l, START, 0.2);
    stage_line_add(&l, START - 1, 0.3);
    assert_int_equal(l.n, 1);
    assert_true(l.place_m[0] == 0.1);
}

static void a_report_from_the_future_does_not_stop_those_that_come(void **state)
{
    struct stage_line l = {.n = 0};
    struct stage_line_fit f;
    (void)state;
    stage_line_add(&l, START + 3600000 * MS, 0.5);
    for (int k = 0; k < 4; k++)
        stage_line_add(&l, START + 50 * k * MS, 0.06 * 0.05 * k);
    assert_true(stage_line_fit(&l, START, START + 4000000 * MS, &f));
    assert_int_equal(f.n, 4);
    assert_true(fabs(f.speed_m_s - 0.06) < 1e-9);
}

static void the_oldest_make_room(void **state)
{
    struct stage_line l = {.n = 0};
    struct stage_line_fit f;
    (void)state;
    for (int k = 0; k < STAGE_LINE_REPORTS + 5; k++)
        stage_line_add(&l, START + k * MS, 1e-4 * k);
    assert_true(stage_line_fit(&l, START, START + 10000 * MS, &f));
    assert_int_equal(f.n, STAGE_LINE_REPORTS);
    assert_false(stage_line_fit(&l, START, START + 6 * MS, &f));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(between_reports_a_stage_goes_straight_on),
        cmocka_unit_test(many_reports_are_better_than_one),
        cmocka_unit_test(only_reports_of_the_span_count_and_three_are_needed),
        cmocka_unit_test(what_is_reported_again_or_late_is_ignored),
        cmocka_unit_test(a_report_from_the_future_does_not_stop_those_that_come),
        cmocka_unit_test(the_oldest_make_room),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
