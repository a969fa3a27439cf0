/* SPDX-License-Identifier: MIT */
/* Hard cases of ADMM: gains, weights, penalties, and data that hold nothing. */
#include "tests/recon/near.h"

#include "tests/recon/admm_rig.h"

#define N ADMM_RIG_SIZE

static void the_gain_of_the_data_only_scales_the_result(void **state)
{
    (void)state;
    static const double gains[6] = {0.03, 30.0, 1e-12, 1e12, 1e-30, 1e30};
    struct admm_config cfg = admm_rig_config;
    struct admm_result r;
    double b[N];
    float data[N], one[N], x[N];
    cfg.l1 = 0.05;
    cfg.tv = 0.02;
    cfg.tolerance = 1e-4;
    admm_rig_data(1.0, b, data);
    admm_rig_solve(&cfg, 1, data, one, &r);
    for (int g = 0; g < 6; g++) {
        admm_rig_data(gains[g], b, data);
        admm_rig_solve(&cfg, 1, data, x, &r);
        for (size_t i = 0; i < N; i++)
            assert_near(x[i] / gains[g], one[i], 1e-4);
    }
}

static void rho_changes_the_way_and_not_the_goal(void **state)
{
    (void)state;
    struct admm_config cfg = admm_rig_config;
    struct admm_result r, first;
    double b[N];
    float data[N], x[N];
    admm_rig_data(1.0, b, data);
    for (int weighted = 0; weighted < 2; weighted++) {
        cfg.l1 = 0.05 * weighted;
        cfg.tv = 0.02 * weighted;
        cfg.rho = 0.1;
        admm_rig_solve(&cfg, 1, data, x, &first);
        for (double rho = 1e-3; rho < 2e3; rho *= 10.0) {
            cfg.rho = rho;
            admm_rig_solve(&cfg, 1, data, x, &r);
            assert_near(r.objective / first.objective, 1.0, 1e-4);
        }
    }
}

static const double weights[4][2] = {{0, 0}, {0.05, 0}, {0, 0.05}, {0.05, 0.05}};

static void silence_and_constants_are_left_as_they_are(void **state)
{
    (void)state;
    enum { SILENCE, CONSTANT, DENORMAL, KINDS };
    for (int q = 0; q < KINDS * 8; q++) {
        int kind = q / 8, w = q % 8;
        struct admm_config cfg = admm_rig_config;
        struct admm_result r;
        float b[N] = {0}, x[N];
        cfg.iterations = 200;
        cfg.l1 = weights[w / 2][0];
        cfg.tv = weights[w / 2][1];
        cfg.tv_isotropic = w % 2;
        for (size_t i = 0; i < N; i++)
            b[i] = kind == CONSTANT ? 0.7f : kind == DENORMAL ? 1e-41f : 0.0f;
        admm_rig_solve(&cfg, 2, b, x, &r);
        for (size_t i = 0; i < N; i++) {
            if (kind == SILENCE || kind == DENORMAL)
                assert_true(x[i] == 0.0f);
            if (kind == CONSTANT) /* no blur and no edge in it: the weight is taken off */
                assert_near(x[i], 0.7 * (1.0 - cfg.l1), 2e-3);
        }
    }
}

/* Over the largest of K' b; they become those of the problem. */
static void expect_weights(struct primal_dual *p, const double weight[2],
                           const struct admm_result *r)
{
    double back[PRIMAL_DUAL_MAX], largest = 0.0;
    primal_dual_adjoint(p, p->b, back);
    for (size_t i = 0; i < p->size; i++)
        largest = fmax(largest, back[i]);
    p->l1 = weight[0] * largest;
    p->tv = weight[1] * largest;
    assert_near(r->l1_weight, p->l1, 1e-6 * largest);
    assert_near(r->tv_weight, p->tv, 1e-6 * largest);
}

/* Against the solver that shares nothing with it. */
static void a_spike_is_sharpened_to_the_optimum(void **state)
{
    (void)state;
    static double k[N * N];
    double b[N] = {[100] = 5.0};
    float data[N], x[N];
    struct primal_dual p = {
        .n = {5, 3, 7}, .size = N, .n_data = N, .k = k, .b = b, .wrap = true};
    admm_rig_float(b, N, data);
    primal_dual_blur(&p, admm_rig_tilted);
    for (int q = 0; q < 8; q++) {
        struct admm_config cfg = admm_rig_config;
        struct admm_result r;
        cfg.l1 = weights[q / 2][0];
        cfg.tv = weights[q / 2][1];
        cfg.tv_isotropic = p.isotropic = q % 2;
        admm_rig_solve(&cfg, 2, data, x, &r);
        expect_weights(&p, weights[q / 2], &r);
        admm_rig_expect_optimum(&p, &r, x, 2e-5);
    }
}

static void weights_from_1_on_leave_nothing(void **state)
{
    (void)state;
    struct admm_config cfg = admm_rig_config;
    struct admm_result r;
    double b[N];
    float data[N], x[N], most = 0.0f;
    cfg.l1 = 1.0;
    cfg.tv = 0.1;
    admm_rig_data(1.0, b, data);
    admm_rig_solve(&cfg, 1, data, x, &r);
    assert_true(r.converged);
    for (size_t i = 0; i < N; i++)
        assert_true(x[i] == 0.0f);
    cfg.l1 = 0.9;
    cfg.tv = 0.0;
    admm_rig_solve(&cfg, 1, data, x, &r);
    for (size_t i = 0; i < N; i++)
        most = fmaxf(most, x[i]);
    assert_true(most > 0.0f);
}

static void threads_do_not_change_the_result(void **state)
{
    (void)state;
    struct admm_config cfg = admm_rig_config;
    struct admm_result r[2];
    double b[N];
    float data[N], x[2][N];
    cfg.l1 = cfg.tv = 0.03;
    admm_rig_data(1.0, b, data);
    for (size_t t = 0; t < 2; t++)
        admm_rig_solve(&cfg, 1 + 3 * t, data, x[t], &r[t]);
    assert_memory_equal(x[0], x[1], N * sizeof(float));
    assert_int_equal(r[0].iterations, r[1].iterations);
}

static void the_stopping_rule_stops(void **state)
{
    (void)state;
    struct admm_config cfg = admm_rig_config;
    struct admm_result r;
    double b[N];
    float data[N], x[N];
    size_t before = 0;
    cfg.l1 = cfg.tv = 0.03;
    admm_rig_data(1.0, b, data);
    for (double tolerance = 1e-2; tolerance > 1e-6; tolerance *= 0.1) {
        cfg.tolerance = tolerance;
        admm_rig_solve(&cfg, 1, data, x, &r);
        assert_true(r.converged && r.primal <= tolerance && r.dual <= tolerance);
        assert_true(r.iterations >= before && r.iterations < cfg.iterations);
        before = r.iterations;
    }
    cfg.iterations = 3;
    admm_rig_solve(&cfg, 1, data, x, &r);
    assert_false(r.converged);
    assert_int_equal(r.iterations, 3);
}

/* -- any operator -----------------------------------------------------------------------
 * y_i = gain (x_i + x_i+1): its transpose by hand; nothing is known of the last one. */

#define LENGTH 60

static void pair_forward(void *ctx, const float *x, float *y)
{
    const float *gain = ctx;
    for (size_t i = 0; i + 1 < LENGTH; i++)
        y[i] = *gain * (x[i] + x[i + 1]);
}

static void pair_adjoint(void *ctx, const float *y, float *x)
{
    const float *gain = ctx;
    for (size_t i = 0; i < LENGTH; i++)
        x[i] = *gain * ((i ? y[i - 1] : 0.0f) + (i + 1 < LENGTH ? y[i] : 0.0f));
}

static void solve_weighted(float gain, double rho, const double weight[2], const float *b,
                           float *x, struct admm_result *r)
{
    const struct admm_operator linear = {&gain, pair_forward, pair_adjoint, LENGTH - 1};
    const struct admm_config cfg = {.n = {5, 4, 3},
                                    .l1 = weight[0],
                                    .tv = weight[1],
                                    .rho = rho,
                                    .iterations = 800,
                                    .tolerance = 1e-4,
                                    .linear = &linear};
    struct pool *pool;
    struct admm *a = admm_rig_create(&cfg, 2, &pool);
    admm_solve(a, b, 0.0, x, r);
    for (size_t i = 0; i < LENGTH; i++)
        assert_true(isfinite(x[i]) && x[i] >= 0.0f);
    assert_true(isfinite(r->objective) && isfinite(r->primal) && isfinite(r->dual));
    admm_destroy(a);
    pool_destroy(pool);
}

static void solve_pairs(float gain, double rho, double weight, const float *b, float *x,
                        struct admm_result *r)
{
    const double both[2] = {weight, weight};
    solve_weighted(gain, rho, both, b, x, r);
}

static void spikes_and_constants_behind_an_operator_reach_the_optimum(void **state)
{
    (void)state;
    static double k[(LENGTH - 1) * LENGTH];
    double b[LENGTH - 1];
    float data[LENGTH - 1], x[LENGTH];
    struct primal_dual p = {
        .n = {5, 4, 3}, .size = LENGTH, .n_data = LENGTH - 1, .k = k, .b = b};
    for (size_t i = 0; i + 1 < LENGTH; i++)
        k[i * LENGTH + i] = k[i * LENGTH + i + 1] = 0.5;
    for (int q = 0; q < 8; q++) {
        struct admm_result r;
        for (size_t i = 0; i + 1 < LENGTH; i++)
            b[i] = q % 2 ? 0.7 : i == 30 ? 5.0 : 0.0;
        admm_rig_float(b, LENGTH - 1, data);
        solve_weighted(0.5f, 0.1, weights[q / 2], data, x, &r);
        expect_weights(&p, weights[q / 2], &r);
        assert_true(r.converged);
        if (q % 2 && p.l1 == 0.0)            /* nothing speaks against a constant */
            assert_below(r.objective, 1e-3); /* 14.5 at 0 */
        else
            admm_rig_expect_optimum(&p, &r, x, 1e-3);
    }
}

static void an_operator_takes_any_rho_and_any_gain(void **state)
{
    (void)state;
    static const float gains[4] = {1e-12f, 0.03f, 30.0f, 1e12f};
    struct admm_result r, first;
    float b[LENGTH - 1] = {0}, x[LENGTH], one[LENGTH];
    for (size_t i = 20; i < 32; i++)
        b[i] = 2.0f;
    solve_pairs(1.0f, 0.1, 0.02, b, one, &first);
    for (double rho = 1e-3; rho < 2e3; rho *= 10.0) {
        solve_pairs(1.0f, rho, 0.02, b, x, &r);
        assert_near(r.objective / first.objective, 1.0, 2e-3);
    }
    for (int g = 0; g < 4; g++) { /* of the operator, then of the data too */
        solve_pairs(gains[g], 0.1, 0.02, b, x, &r);
        for (size_t i = 0; i < LENGTH; i++)
            assert_near((double)x[i] * (double)gains[g], one[i], 1e-3);
        float data[LENGTH - 1];
        for (size_t i = 0; i + 1 < LENGTH; i++)
            data[i] = gains[g] * b[i];
        solve_pairs(gains[g], 0.1, 0.02, data, x, &r);
        for (size_t i = 0; i < LENGTH; i++)
            assert_near(x[i], one[i], 1e-3);
    }
}

static void an_operator_that_passes_nothing_shows_nothing(void **state)
{
    (void)state;
    static const float gains[3] = {0.0f, 1.0f, 1.0f}, level[3] = {1.0f, 0.0f, 1e-41f};
    for (int q = 0; q < 3; q++) {
        for (int weighted = 0; weighted < 2; weighted++) {
            struct admm_result r;
            float b[LENGTH - 1], x[LENGTH];
            for (size_t i = 0; i + 1 < LENGTH; i++)
                b[i] = level[q];
            solve_pairs(gains[q], 0.1, 0.05 * weighted, b, x, &r);
            for (size_t i = 0; i < LENGTH; i++)
                assert_true(x[i] == 0.0f);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_gain_of_the_data_only_scales_the_result),
        cmocka_unit_test(rho_changes_the_way_and_not_the_goal),
        cmocka_unit_test(silence_and_constants_are_left_as_they_are),
        cmocka_unit_test(a_spike_is_sharpened_to_the_optimum),
        cmocka_unit_test(weights_from_1_on_leave_nothing),
        cmocka_unit_test(threads_do_not_change_the_result),
        cmocka_unit_test(the_stopping_rule_stops),
        cmocka_unit_test(spikes_and_constants_behind_an_operator_reach_the_optimum),
        cmocka_unit_test(an_operator_takes_any_rho_and_any_gain),
        cmocka_unit_test(an_operator_that_passes_nothing_shows_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
