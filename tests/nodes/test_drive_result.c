/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "nodes/anlos/score/drive_result.h"
#include "tests/nodes/near.h"

/* exp(-m) = 1 - confidence. */
static void of_nothing_the_bound_is_a_logarithm(void **state)
{
    (void)state;
    assert_near(poisson_bound(0, 0.95), -log(0.05), 1e-9);
    assert_near(poisson_bound(0, 0.5), log(2.0), 1e-9);
}

/* Half of the 0.95 quantile of chi square with 2 n + 2 degrees of freedom, as tables have
 * it: 9.4877, 21.0261, 33.9244, and 124.3421 of 100. */
static void the_bound_is_that_of_the_tables(void **state)
{
    (void)state;
    assert_near(poisson_bound(1, 0.95), 9.4877 / 2.0, 1e-4);
    assert_near(poisson_bound(5, 0.95), 21.0261 / 2.0, 1e-4);
    assert_near(poisson_bound(10, 0.95), 33.9244 / 2.0, 1e-4);
    assert_near(poisson_bound(49, 0.95), 124.3421 / 2.0, 1e-4);
}

static struct drive_result result(double gospa_m, size_t n, size_t n_false)
{
    return (struct drive_result){.seconds = 600.0,
                                 .n_lists = n,
                                 .gospa = {gospa_m * (double)n, n},
                                 .seen = {0.5 * (double)n, n},
                                 .n_false_tracks = n_false};
}

static void drives_add_up_and_the_worst_is_kept(void **state)
{
    (void)state;
    struct drive_tally t;
    struct drive_result a = result(0.1, 100, 0), b = result(0.4, 300, 2);

    b.seen.sum = 0.9 * 300.0;
    drive_tally_init(&t);
    drive_tally_add(&t, &a);
    drive_tally_add(&t, &b);
    assert_int_equal(t.n, 2);
    assert_int_equal(t.all.n_lists, 400);
    assert_near(drive_figure(&t.all, DRIVE_GOSPA), (0.1 * 100 + 0.4 * 300) / 400, 1e-9);
    assert_near(t.worst[DRIVE_GOSPA], 0.4, 1e-9);
    assert_near(t.worst[DRIVE_SEEN], 0.5, 1e-9); /* there less is worse */
    assert_near(t.worst[DRIVE_FALSE_TRACKS], 2.0, 1e-9);
    assert_true(isnan(t.worst[DRIVE_LEAD])); /* nobody came into view */
}

/* 2 in 1200 s; 12.5916 / 2 is the bound of 2. */
static void false_tracks_are_those_of_an_hour(void **state)
{
    (void)state;
    struct drive_tally t;
    struct drive_result a = result(0.1, 100, 0), b = result(0.4, 300, 2);

    drive_tally_init(&t);
    drive_tally_add(&t, &a);
    drive_tally_add(&t, &b);
    assert_near(drive_false_per_hour(&t.all), 6.0, 1e-9);
    assert_near(drive_false_per_hour_bound(&t.all), 3.0 * 12.5916 / 2.0, 1e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(of_nothing_the_bound_is_a_logarithm),
        cmocka_unit_test(the_bound_is_that_of_the_tables),
        cmocka_unit_test(drives_add_up_and_the_worst_is_kept),
        cmocka_unit_test(false_tracks_are_those_of_an_hour),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
