/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include "recon/inverse/admm_subspace.h"

/* M = 1 + i on the diagonal; directions e_0 + e_1, again the same, and e_2. */
static void the_minimum_over_a_span_is_found_though_a_direction_comes_twice(void **state)
{
    (void)state;
    enum { SIZE = 40 };
    struct pool *pool;
    struct admm_subspace *s;
    float residual[SIZE], x[SIZE] = {0}, mx[SIZE] = {0};
    static const size_t members[3][2] = {{0, 1}, {0, 1}, {2, 2}};
    assert_int_equal(pool_create(&pool, 2), 0);
    assert_int_equal(admm_subspace_create(&s, SIZE, pool), 0);
    for (int d = 0; d < 3; d++) {
        struct admm_direction next = admm_subspace_next(s);
        for (size_t i = 0; i < SIZE; i++) {
            next.p[i] = i == members[d][0] || i == members[d][1];
            next.mp[i] = (float)(1 + i) * next.p[i];
        }
        admm_subspace_keep(s);
    }
    for (size_t i = 0; i < SIZE; i++)
        residual[i] = 6.0f;
    admm_subspace_descend(s, residual, x, mx);
    assert_near(x[0], 4.0, 1e-5); /* (6 + 6) / (1 + 2) */
    assert_near(x[1], 4.0, 1e-5);
    assert_near(x[2], 2.0, 1e-5); /* 6 / 3 */
    assert_near(residual[0] + residual[1], 0.0, 1e-4);
    for (size_t i = 0; i < SIZE; i++) {
        assert_near(mx[i], (double)(1 + i) * (double)x[i], 1e-4);
        assert_near(residual[i] + mx[i], 6.0, 1e-5);
    }
    admm_subspace_destroy(s);
    pool_destroy(pool);
}

/* One after the other they are residuals: as steepest descent, but with memory the end
 * comes after as many as M has different eigenvalues. */
static void with_memory_the_descent_ends(void **state)
{
    (void)state;
    enum { SIZE = 30 };
    struct pool *pool;
    struct admm_subspace *s;
    float residual[SIZE], x[SIZE] = {0}, mx[SIZE] = {0};
    assert_int_equal(pool_create(&pool, 1), 0);
    assert_int_equal(admm_subspace_create(&s, SIZE, pool), 0);
    for (size_t i = 0; i < SIZE; i++)
        residual[i] = (float)(1 + i % 7);
    for (int step = 0; step < 6; step++) {
        struct admm_direction next = admm_subspace_next(s);
        for (size_t i = 0; i < SIZE; i++) {
            next.p[i] = residual[i];
            next.mp[i] = (float)(1 + i % 5 * i % 5) * residual[i];
        }
        admm_subspace_keep(s);
        admm_subspace_descend(s, residual, x, mx);
    }
    for (size_t i = 0; i < SIZE; i++)
        assert_near(x[i], (double)(1 + i % 7) / (double)(1 + i % 5 * i % 5), 1e-4);
    admm_subspace_destroy(s);
    pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_minimum_over_a_span_is_found_though_a_direction_comes_twice),
        cmocka_unit_test(with_memory_the_descent_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
