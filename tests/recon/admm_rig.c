/* SPDX-License-Identifier: MIT */
#include "tests/recon/admm_rig.h"

#include "tests/recon/near.h"
#include "tests/recon/reference.h"

/* Of a blur, far below the tolerances; an operator of less rank takes longer. */
#define REFERENCE_ROUNDS 4000

const struct admm_config admm_rig_config = {
    .n = {5, 3, 7}, .rho = 0.1, .iterations = 3000, .tolerance = 1e-6};

const double admm_rig_tilted[6] = {1.3, 0.4, -0.3, 0.9, 0.2, 1.1};

void admm_rig_float(const double *x, size_t n, float *out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = (float)x[i];
}

void admm_rig_data(double gain, double b[ADMM_RIG_SIZE], float data[ADMM_RIG_SIZE])
{
    unsigned long long seed = 11;
    for (size_t i = 0; i < ADMM_RIG_SIZE; i++)
        b[i] = gain *
               (0.1 * reference_random(&seed) + (i % 41 == 3) + 0.7 * (i / 15 % 4 == 1));
    if (data)
        admm_rig_float(b, ADMM_RIG_SIZE, data);
}

struct admm *admm_rig_create(const struct admm_config *cfg, size_t threads,
                             struct pool **pool)
{
    struct admm_config own = *cfg;
    struct admm *a = NULL;
    assert_int_equal(pool_create(pool, threads), 0);
    own.pool = *pool;
    assert_int_equal(admm_create(&a, &own), 0);
    return a;
}

void admm_rig_solve(const struct admm_config *cfg, size_t threads,
                    const float b[ADMM_RIG_SIZE], float x[ADMM_RIG_SIZE],
                    struct admm_result *r)
{
    struct pool *pool;
    struct admm *a = admm_rig_create(cfg, threads, &pool);
    admm_blur_gaussian(a, admm_rig_tilted);
    admm_solve(a, b, 0.0, x, r);
    for (size_t i = 0; i < ADMM_RIG_SIZE; i++)
        assert_true(isfinite(x[i]) && x[i] >= 0.0f);
    assert_true(isfinite(r->objective) && isfinite(r->primal) && isfinite(r->dual));
    admm_destroy(a);
    pool_destroy(pool);
}

void admm_rig_expect_optimum(const struct primal_dual *p, const struct admm_result *r,
                             const float *x, double tolerance)
{
    static double expected[PRIMAL_DUAL_MAX], got[PRIMAL_DUAL_MAX];
    primal_dual_solve(p, REFERENCE_ROUNDS, expected);
    for (size_t i = 0; i < p->size; i++)
        got[i] = x[i];
    double best = primal_dual_objective(p, expected);
    assert_near(primal_dual_objective(p, got) / best, 1.0, tolerance);
    assert_near(r->objective / best, 1.0, 5.0 * tolerance);
}
