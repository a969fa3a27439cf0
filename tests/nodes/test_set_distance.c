/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "nodes/anlos/score/drive_score.h"
#include "tests/nodes/near.h"

static struct bench_set_distance d;

static void nothing_and_nothing_are_equal(void **state)
{
    (void)state;
    bench_set_distance(&d, NULL, 0, NULL, 0, 1.0, 2.0);
    assert_true(d.gospa_m == 0.0 && d.ospa_m == 0.0);
}

/* One 0.3 m off, one 0.4 m off: sqrt(0.09 + 0.16) = 0.5; OSPA a mean: sqrt(0.125). */
static void places_that_are_off_count_by_their_distance(void **state)
{
    const double truth[2][2] = {{0.0, 0.0}, {5.0, 5.0}};
    const double found[2][2] = {{5.0, 5.4}, {0.3, 0.0}};

    (void)state;
    bench_set_distance(&d, truth, 2, found, 2, 1.0, 2.0);
    assert_near(d.gospa_m, 0.5, 1e-12);
    assert_near(d.ospa_m, sqrt(0.125), 1e-12);
    assert_int_equal(d.match[0], 1);
    assert_int_equal(d.match[1], 0);
}

/* c = 2, p = 2: 0.25 and one missed, 4 / 2: sqrt(2.25) = 1.5; OSPA: (0.25 + 4) / 2. */
static void what_is_missed_costs_half_the_cutoff(void **state)
{
    const double truth[2][2] = {{0.0, 0.0}, {5.0, 5.0}};
    const double found[1][2] = {{5.0, 5.5}};

    (void)state;
    bench_set_distance(&d, truth, 2, found, 1, 2.0, 2.0);
    assert_near(d.gospa_m, 1.5, 1e-12);
    assert_near(d.ospa_m, sqrt(2.125), 1e-12);
    assert_near(d.localisation, 0.25, 1e-12);
    assert_near(d.missed, 2.0, 1e-12);
    assert_near(d.false_ones, 0.0, 1e-12);
    assert_int_equal(d.match[0], BENCH_NOBODY);
    assert_int_equal(d.match[1], 0);
    bench_set_distance(&d, found, 1, truth, 2, 2.0, 2.0);
    assert_near(d.gospa_m, 1.5, 1e-12);
    assert_int_equal(d.n_false, 1);
    assert_int_equal(d.n_missed, 0);
}

/* Too far to be a pair: one is missed and one is false, 2 c^p / 2; OSPA knows c. */
static void beyond_the_cutoff_it_is_another_object(void **state)
{
    const double truth[1][2] = {{0.0, 0.0}}, found[1][2] = {{3.0, 0.0}};

    (void)state;
    bench_set_distance(&d, truth, 1, found, 1, 2.0, 1.0);
    assert_near(d.gospa_m, 2.0, 1e-12);
    assert_near(d.ospa_m, 2.0, 1e-12);
    assert_int_equal(d.n_missed, 1);
    assert_int_equal(d.n_false, 1);
}

/* Nearest first would pair 0.9 with 1.0 and leave 0 and 2.1; the best total does not. */
static void the_pairing_is_the_best_of_all(void **state)
{
    const double truth[2][2] = {{0.0, 0.0}, {1.0, 0.0}};
    const double found[2][2] = {{0.9, 0.0}, {2.1, 0.0}};

    (void)state;
    bench_set_distance(&d, truth, 2, found, 2, 1.5, 1.0);
    assert_near(d.gospa_m, 0.1 + 1.5, 1e-12); /* not 0.9 + 1.1 */
    bench_set_distance(&d, truth, 2, found, 2, 10.0, 1.0);
    assert_near(d.gospa_m, 2.0, 1e-12);
}

/* d(a, c) <= d(a, b) + d(b, c) on sets of several sizes. */
static void it_is_a_metric(void **state)
{
    const double a[3][2] = {{0.0, 0.0}, {1.0, 1.0}, {3.0, 0.0}};
    const double b[2][2] = {{0.5, 0.2}, {2.4, 0.1}}, c[1][2] = {{1.0, 0.5}};
    struct bench_set_distance ac, ab, bc;

    (void)state;
    bench_set_distance(&ac, a, 3, c, 1, 1.0, 2.0);
    bench_set_distance(&ab, a, 3, b, 2, 1.0, 2.0);
    bench_set_distance(&bc, b, 2, c, 1, 1.0, 2.0);
    assert_true(ac.gospa_m <= ab.gospa_m + bc.gospa_m);
    assert_true(ac.ospa_m <= ab.ospa_m + bc.ospa_m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_and_nothing_are_equal),
        cmocka_unit_test(places_that_are_off_count_by_their_distance),
        cmocka_unit_test(what_is_missed_costs_half_the_cutoff),
        cmocka_unit_test(beyond_the_cutoff_it_is_another_object),
        cmocka_unit_test(the_pairing_is_the_best_of_all),
        cmocka_unit_test(it_is_a_metric),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
