/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>

#include "tests/recon/admm_rig.h"
#include "tests/recon/reference.h"

#define N ADMM_RIG_SIZE

static void expect_optimum_of_blur(double l1, double tv, bool isotropic)
{
    static double k[N * N];
    double b[N];
    float data[N], x[N];
    struct primal_dual p = {.n = {5, 3, 7},
                            .size = N,
                            .n_data = N,
                            .k = k,
                            .b = b,
                            .wrap = true,
                            .isotropic = isotropic,
                            .l1 = l1,
                            .tv = tv};
    struct admm_config cfg = admm_rig_config;
    struct admm_result r;
    struct pool *pool;
    admm_rig_data(1.0, b, data);
    primal_dual_blur(&p, admm_rig_tilted);
    cfg.l1 = l1;
    cfg.tv = tv;
    cfg.tv_isotropic = isotropic;
    struct admm *a = admm_rig_create(&cfg, 2, &pool);
    admm_blur_gaussian(a, admm_rig_tilted);
    admm_solve(a, data, 1.0, x, &r);
    assert_near(r.l1_weight, l1, 1e-6);
    assert_near(r.tv_weight, tv, 1e-6);
    admm_rig_expect_optimum(&p, &r, x, 2e-5);
    admm_destroy(a);
    pool_destroy(pool);
}

static void the_optimum_is_that_of_an_independent_solver(void **state)
{
    (void)state;
    expect_optimum_of_blur(0.05, 0.03, false);
    expect_optimum_of_blur(0.05, 0.03, true);
    expect_optimum_of_blur(0.05, 0.0, false);
}

static void without_blur_the_l1_weight_is_subtracted(void **state)
{
    (void)state;
    struct admm_config cfg = admm_rig_config;
    struct pool *pool;
    double b[N];
    float data[N], x[N];
    cfg.l1 = 0.2;
    struct admm *a = admm_rig_create(&cfg, 1, &pool);
    admm_rig_data(1.0, b, data);
    admm_solve(a, data, 1.0, x, NULL);
    for (size_t i = 0; i < N; i++)
        assert_near(x[i], fmax(b[i] - 0.2, 0.0), 1e-4);
    admm_destroy(a);
    pool_destroy(pool);
}

/* A step of length n between two levels moves each by 2 tv / n. */
static void total_variation_draws_two_levels_together(void **state)
{
    (void)state;
    for (int isotropic = 0; isotropic < 2; isotropic++) {
        struct admm_config cfg = {.n = {1, 1, 40},
                                  .tv = 0.8,
                                  .rho = 0.1,
                                  .tv_isotropic = isotropic,
                                  .iterations = 3000,
                                  .tolerance = 1e-7};
        struct pool *pool;
        float b[40], x[40];
        for (size_t i = 0; i < 40; i++)
            b[i] = i >= 8 && i < 24 ? 1.0f : 0.25f;
        struct admm *a = admm_rig_create(&cfg, 3, &pool);
        admm_solve(a, b, 1.0, x, NULL);
        for (size_t i = 0; i < 40; i++)
            assert_near(x[i], i >= 8 && i < 24 ? 1.0 - 1.6 / 16.0 : 0.25 + 1.6 / 24.0,
                        1e-4);
        admm_destroy(a);
        pool_destroy(pool);
    }
}

static void dense_forward(void *ctx, const float *x, float *y)
{
    double in[PRIMAL_DUAL_MAX], out[PRIMAL_DUAL_MAX];
    const struct primal_dual *p = ctx;
    for (size_t i = 0; i < p->size; i++)
        in[i] = x[i];
    primal_dual_forward(p, in, out);
    admm_rig_float(out, p->n_data, y);
}

static void dense_adjoint(void *ctx, const float *y, float *x)
{
    double in[PRIMAL_DUAL_MAX], out[PRIMAL_DUAL_MAX];
    const struct primal_dual *p = ctx;
    for (size_t r = 0; r < p->n_data; r++)
        in[r] = y[r];
    primal_dual_adjoint(p, in, out);
    admm_rig_float(out, p->size, x);
}

/* Random rows, and what they make of a plate, with noise. */
static void draw_operator(const struct primal_dual *p, double *b)
{
    unsigned long long seed = 5;
    for (size_t q = 0; q < p->n_data * p->size; q++)
        p->k[q] = (reference_random(&seed) - 0.3) / (double)p->n_data;
    for (size_t r = 0; r < p->n_data; r++) {
        b[r] = 1e-3 * (reference_random(&seed) - 0.5);
        for (size_t i = 40; i < 60; i++)
            b[r] += p->k[r * p->size + i];
    }
}

/* Fewer data than voxels, edges that do not wrap, and a gain that is not 1. */
static void any_operator_reaches_its_optimum(void **state)
{
    (void)state;
    static double k[90 * 120];
    double b[90];
    float data[90], x[120];
    struct primal_dual p = {.n = {6, 4, 5}, .size = 120, .n_data = 90, .k = k, .b = b};
    const struct admm_operator linear = {&p, dense_forward, dense_adjoint, p.n_data};
    const struct admm_config cfg = {.n = {6, 4, 5},
                                    .l1 = 0.01,
                                    .tv = 0.02,
                                    .rho = 0.1,
                                    .iterations = 500,
                                    .tolerance = 1e-4,
                                    .linear = &linear};
    struct pool *pool;
    struct admm_result r;
    draw_operator(&p, b);
    admm_rig_float(b, p.n_data, data);
    struct admm *a = admm_rig_create(&cfg, 2, &pool);
    admm_solve(a, data, 0.0, x, &r);
    assert_true(r.converged);
    p.l1 = r.l1_weight;
    p.tv = r.tv_weight;
    admm_rig_expect_optimum(&p, &r, x, 2e-4);
    admm_destroy(a);
    pool_destroy(pool);
}

static void nonsense_is_refused(void **state)
{
    (void)state;
    struct pool *pool;
    struct admm *a = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    for (int q = 0; q < 6; q++) {
        struct admm_config cfg = admm_rig_config;
        cfg.pool = pool;
        cfg.n[0] = q == 0 ? 0 : cfg.n[0];
        cfg.l1 = q == 1 ? -1.0 : q == 2 ? NAN : 0.0;
        cfg.rho = q == 3 ? 0.0 : 1.0;
        cfg.relaxation = q == 4 ? 2.0 : 0.0;
        cfg.tv = q == 5 ? INFINITY : 0.0;
        assert_int_equal(admm_create(&a, &cfg), -EINVAL);
    }
    assert_null(a);
    admm_destroy(NULL);
    pool_destroy(pool);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_optimum_is_that_of_an_independent_solver),
        cmocka_unit_test(without_blur_the_l1_weight_is_subtracted),
        cmocka_unit_test(total_variation_draws_two_levels_together),
        cmocka_unit_test(any_operator_reaches_its_optimum),
        cmocka_unit_test(nonsense_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
