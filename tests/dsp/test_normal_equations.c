/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "dsp/normal_equations.h"
#include "tests/dsp/near.h"

enum { N = 4 };

static void what_is_known_comes_back(void **state)
{
    (void)state;
    const double known[N] = {1.0, -2.0, 0.5, 3.0};
    double a[N][N], x[N] = {0};
    for (int i = 0; i < N; i++) /* Hilbert's, positive definite and badly scaled */
        for (int j = 0; j < N; j++)
            a[i][j] = 1.0 / (i + j + 1.0);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++)
            x[i] += a[i][j] * known[j];
    assert_int_equal(normal_equations_solve(N, a[0], x, 0.0), 0);
    for (int i = 0; i < N; i++)
        assert_near(x[i], known[i], 1e-10);
}

/* Columns 1, t, 2 t and t^2 of a least squares fit: the third says nothing new. */
static void what_others_hold_already_is_left_out(void **state)
{
    (void)state;
    double a[N][N] = {{0}}, x[N] = {0};
    for (int k = -3; k <= 4; k++) {
        double t = 0.1 * k, y = 2.0 - 3.0 * t + 7.0 * t * t;
        const double term[N] = {1.0, t, 2.0 * t, t * t};
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < N; j++)
                a[i][j] += term[i] * term[j];
            x[i] += term[i] * y;
        }
    }
    assert_int_equal(normal_equations_solve(N, a[0], x, 1e-9), 1);
    assert_near(x[0], 2.0, 1e-9);
    assert_near(x[1], -3.0, 1e-9);
    assert_true(x[2] == 0.0);
    assert_near(x[3], 7.0, 1e-9);
}

static void an_unknown_that_nothing_depends_on_is_zero(void **state)
{
    (void)state;
    double a[3][3] = {{0.0, 0.0, 0.0}, {0.0, 2.0, 1.0}, {0.0, 1.0, 3.0}};
    double x[3] = {0.0, 4.0, 7.0};
    assert_int_equal(normal_equations_solve(3, a[0], x, 0.0), 1);
    assert_true(x[0] == 0.0);
    assert_near(x[1], 1.0, 1e-12);
    assert_near(x[2], 2.0, 1e-12);
}

static void what_is_not_positive_is_told(void **state)
{
    (void)state;
    double a[2][2] = {{1.0, 2.0}, {2.0, 1.0}}, x[2] = {1.0, 1.0};
    double nan[1] = {NAN}, y[1] = {1.0};
    assert_int_equal(normal_equations_solve(2, a[0], x, 0.0), 1);
    assert_int_equal(normal_equations_solve(1, nan, y, 0.0), 1);
    assert_true(y[0] == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_known_comes_back),
        cmocka_unit_test(what_others_hold_already_is_left_out),
        cmocka_unit_test(an_unknown_that_nothing_depends_on_is_zero),
        cmocka_unit_test(what_is_not_positive_is_told),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
