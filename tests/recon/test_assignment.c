/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/tracking/assignment.h"
#include "tests/recon/reference.h"

/* The least total of all ways to give rows from `row` on columns that are free. */
static double try_all(size_t n_rows, size_t n_columns, const double *cost, size_t row,
                      unsigned taken)
{
    double least = INFINITY;

    if (row == n_rows)
        return 0.0;
    for (size_t c = 0; c < n_columns; c++)
        if (!(taken & 1u << c))
            least = fmin(least,
                         cost[row * n_columns + c] +
                             try_all(n_rows, n_columns, cost, row + 1, taken | 1u << c));
    return least;
}

static void it_costs_as_little_as_the_best_of_all_ways(void **state)
{
    unsigned long long seed = 5;
    double cost[6 * 7];
    size_t column[6];

    (void)state;
    for (int trial = 0; trial < 300; trial++) {
        size_t n_rows = 1 + (size_t)trial % 6, n_columns = n_rows + (size_t)trial % 2;
        for (size_t i = 0; i < n_rows * n_columns; i++)
            cost[i] = 20.0 * reference_random(&seed) - 10.0;
        double total = assignment_solve(n_rows, n_columns, cost, column), sum = 0.0;
        assert_near(total, try_all(n_rows, n_columns, cost, 0, 0), 1e-9);
        for (size_t r = 0; r < n_rows; r++)
            sum += cost[r * n_columns + column[r]];
        assert_near(sum, total, 1e-9);
    }
}

static void each_row_gets_a_column_of_its_own(void **state)
{
    unsigned long long seed = 6;
    static double cost[ASSIGNMENT_ROWS * ASSIGNMENT_COLUMNS];
    size_t column[ASSIGNMENT_ROWS], users[ASSIGNMENT_COLUMNS] = {0};

    (void)state;
    for (size_t i = 0; i < sizeof cost / sizeof *cost; i++)
        cost[i] = reference_random(&seed);
    assignment_solve(ASSIGNMENT_ROWS, ASSIGNMENT_COLUMNS, cost, column);
    for (size_t r = 0; r < ASSIGNMENT_ROWS; r++) {
        assert_true(column[r] < ASSIGNMENT_COLUMNS);
        assert_int_equal(users[column[r]]++, 0);
    }
}

/* Rows and columns shuffled: the sum of (i - j)^2 is least, 0, where j = i. */
static void the_largest_problem_finds_its_hidden_diagonal(void **state)
{
    static double cost[64 * 64];
    size_t column[64];

    (void)state;
    for (size_t r = 0; r < 64; r++)
        for (size_t c = 0; c < 64; c++) {
            double off = (double)(r * 29 % 64) - (double)(c * 11 % 64);
            cost[r * 64 + c] = off * off;
        }
    assert_near(assignment_solve(64, 64, cost, column), 0.0, 1e-9);
    for (size_t r = 0; r < 64; r++)
        assert_int_equal(column[r] * 11 % 64, r * 29 % 64);
}

static void nobody_needs_nothing(void **state)
{
    (void)state;
    assert_true(assignment_solve(0, 5, NULL, NULL) == 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_costs_as_little_as_the_best_of_all_ways),
        cmocka_unit_test(each_row_gets_a_column_of_its_own),
        cmocka_unit_test(the_largest_problem_finds_its_hidden_diagonal),
        cmocka_unit_test(nobody_needs_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
