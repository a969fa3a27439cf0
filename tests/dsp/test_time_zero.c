/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>

#include "dsp/time_zero.h"
#include "tests/dsp/near.h"

#define LATENCY_S 2.5e-3
#define SPEED_M_S 344.3
enum { N = 64 };

/* Distances of 0.08 to 1.08 m; scatter_s alternates, so that it averages to nothing. */
static void arrivals(struct time_zero_pair *p, size_t n, double scatter_s)
{
    for (size_t i = 0; i < n; i++) {
        p[i].distance_m = 0.08 + (double)i / (double)(n - 1);
        p[i].arrival_s = LATENCY_S + p[i].distance_m / SPEED_M_S +
                         (i % 4 == 0 || i % 4 == 3 ? scatter_s : -scatter_s);
    }
}

static void the_latency_is_what_distance_does_not_explain(void **state)
{
    struct time_zero_pair p[N];
    struct time_zero z;
    (void)state;
    arrivals(p, N, 1e-6);
    assert_int_equal(time_zero_fit(&z, p, N, SPEED_M_S), 0);
    assert_near(z.latency_s, LATENCY_S, 1e-8);
    assert_near(z.spread_s, 1.4826e-6, 1e-9);
    assert_int_equal(z.n_heard, N);
    assert_int_equal(z.n_used, N);
    assert_near(z.latency_sigma_s, 1e-6 / 8, 1e-8); /* 1 us over the root of 64 */
}

static void many_distances_tell_the_speed_as_well(void **state)
{
    struct time_zero_pair p[N];
    struct time_zero z;
    (void)state;
    arrivals(p, N, 1e-6);
    assert_int_equal(time_zero_fit_speed(&z, p, N, 330.0), 0);
    assert_near(z.latency_s, LATENCY_S, 1e-7);
    assert_near(z.speed_m_s, SPEED_M_S, 0.05);
    /* sigma of the slope: 1 us / sqrt(64) over the distances' deviation, 0.293 m */
    double expected = 1e-6 / 8 / 0.293 * SPEED_M_S * SPEED_M_S;
    assert_near(z.speed_sigma_m_s, expected, 0.1 * expected);
}

static void a_third_of_wrong_arrivals_does_not_matter(void **state)
{
    struct time_zero_pair p[N];
    struct time_zero z;
    (void)state;
    arrivals(p, N, 1e-6);
    for (size_t i = 0; i < N; i += 3)
        p[i].arrival_s += 1e-3 * (double)(i + 5);
    assert_int_equal(time_zero_fit(&z, p, N, SPEED_M_S), 0);
    assert_near(z.latency_s, LATENCY_S, 1e-6);
    assert_int_equal(z.n_used, N - 22);
    assert_int_equal(z.n_heard, N);
    assert_int_equal(time_zero_fit_speed(&z, p, N, 330.0), 0);
    assert_near(z.latency_s, LATENCY_S, 1e-6);
    assert_near(z.speed_m_s, SPEED_M_S, 0.3);
}

static void what_was_not_heard_is_left_out(void **state)
{
    struct time_zero_pair p[4];
    struct time_zero z;
    (void)state;
    arrivals(p, 4, 0.0);
    p[0].arrival_s = p[2].arrival_s = NAN;
    assert_int_equal(time_zero_fit(&z, p, 4, SPEED_M_S), 0);
    assert_int_equal(z.n_heard, 2);
    assert_near(z.latency_s, LATENCY_S, 1e-9);
    assert_int_equal(time_zero_fit_speed(&z, p, 4, SPEED_M_S), -ENODATA);
    p[1].arrival_s = p[3].arrival_s = NAN;
    assert_int_equal(time_zero_fit(&z, p, 4, SPEED_M_S), -ENODATA);
}

static void one_pair_gives_a_latency_of_unknown_error(void **state)
{
    const struct time_zero_pair p = {0.5, LATENCY_S + 0.5 / SPEED_M_S};
    struct time_zero z;
    (void)state;
    assert_int_equal(time_zero_fit(&z, &p, 1, SPEED_M_S), 0);
    assert_near(z.latency_s, LATENCY_S, 1e-12);
    assert_true(isinf(z.latency_sigma_s));
}

static void equal_distances_do_not_tell_the_speed(void **state)
{
    struct time_zero_pair p[8];
    struct time_zero z;
    (void)state;
    for (size_t i = 0; i < 8; i++)
        p[i] = (struct time_zero_pair){0.3, LATENCY_S + 0.3 / SPEED_M_S};
    assert_int_equal(time_zero_fit_speed(&z, p, 8, SPEED_M_S), -ENODATA);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_latency_is_what_distance_does_not_explain),
        cmocka_unit_test(many_distances_tell_the_speed_as_well),
        cmocka_unit_test(a_third_of_wrong_arrivals_does_not_matter),
        cmocka_unit_test(what_was_not_heard_is_left_out),
        cmocka_unit_test(one_pair_gives_a_latency_of_unknown_error),
        cmocka_unit_test(equal_distances_do_not_tell_the_speed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
