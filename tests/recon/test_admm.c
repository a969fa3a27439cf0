#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/admm.h"
#include "tests/recon/reference.h"

#define N_MAX 128

/* -- an independent solver in double precision ------------------------------------------
 * Chambolle and Pock 2011 on dense matrices: K row by row, D as index pairs. */

struct problem {
    size_t n[3], size, n_data;
    double *k; /* [n_data][size] */
    const double *b;
    bool wrap, isotropic;
    double l1, tv;
};

static size_t behind(const struct problem *p, size_t i, int axis)
{
    size_t at[3] = {i % p->n[0], i / p->n[0] % p->n[1], i / (p->n[0] * p->n[1])};
    if (at[axis] + 1 == p->n[axis] && !p->wrap)
        return i;
    at[axis] = (at[axis] + 1) % p->n[axis];
    return (at[2] * p->n[1] + at[1]) * p->n[0] + at[0];
}

static void multiply(const struct problem *p, const double *x, double *y)
{
    for (size_t r = 0; r < p->n_data; r++) {
        y[r] = 0.0;
        for (size_t i = 0; i < p->size; i++)
            y[r] += p->k[r * p->size + i] * x[i];
    }
}

static double objective(const struct problem *p, const double *x)
{
    double y[N_MAX], sum = 0.0;
    multiply(p, x, y);
    for (size_t r = 0; r < p->n_data; r++)
        sum += 0.5 * pow(y[r] - p->b[r], 2.0);
    for (size_t i = 0; i < p->size; i++) {
        double d[3];
        for (int a = 0; a < 3; a++)
            d[a] = x[behind(p, i, a)] - x[i];
        sum += p->l1 * fabs(x[i]);
        sum += p->tv * (p->isotropic ? sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
                                     : fabs(d[0]) + fabs(d[1]) + fabs(d[2]));
    }
    return sum;
}

static void shrink_dual(const struct problem *p, double v[3])
{
    double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int a = 0; a < 3; a++)
        v[a] = p->isotropic ? v[a] / fmax(1.0, length / p->tv)
                            : fmin(fmax(v[a], -p->tv), p->tv);
}

/* |K| <= 1 and |D|^2 <= 12: steps of 1 / sqrt(13). */
static void solve(const struct problem *p, size_t iterations, double *x)
{
    double step = 0.99 / sqrt(13.0), y[N_MAX], u[N_MAX] = {0}, ahead[N_MAX] = {0};
    static double v[N_MAX][3];
    memset(v, 0, sizeof v);
    memset(x, 0, p->size * sizeof *x);
    for (size_t round = 0; round < iterations; round++) {
        double down[N_MAX];
        multiply(p, ahead, y);
        for (size_t r = 0; r < p->n_data; r++)
            u[r] = (u[r] + step * (y[r] - p->b[r])) / (1.0 + step);
        for (size_t i = 0; p->tv > 0.0 && i < p->size; i++) {
            for (int a = 0; a < 3; a++)
                v[i][a] += step * (ahead[behind(p, i, a)] - ahead[i]);
            shrink_dual(p, v[i]);
        }
        for (size_t i = 0; i < p->size; i++)
            down[i] = p->l1;
        for (size_t r = 0; r < p->n_data; r++)
            for (size_t i = 0; i < p->size; i++)
                down[i] += p->k[r * p->size + i] * u[r];
        for (size_t i = 0; i < p->size; i++)
            for (int a = 0; a < 3; a++) {
                down[behind(p, i, a)] += v[i][a];
                down[i] -= v[i][a];
            }
        for (size_t i = 0; i < p->size; i++) {
            double next = fmax(x[i] - step * down[i], 0.0);
            ahead[i] = 2.0 * next - x[i];
            x[i] = next;
        }
    }
}

/* -- problems ---------------------------------------------------------------------------
 */

static const double tilted[6] = {1.3, 0.4, -0.3, 0.9, 0.2, 1.1};

/* A periodic Gaussian blur with a tilt, from the sum over its frequencies. */
static void blur_matrix(struct problem *p, const double c[6])
{
    double kernel[N_MAX];
    for (size_t d = 0; d < p->size; d++) {
        size_t at[3] = {d % p->n[0], d / p->n[0] % p->n[1], d / (p->n[0] * p->n[1])};
        kernel[d] = 0.0;
        for (size_t k = 0; k < p->size; k++) {
            size_t f[3] = {k % p->n[0], k / p->n[0] % p->n[1], k / (p->n[0] * p->n[1])};
            double w[3], phase = 0.0;
            for (int a = 0; a < 3; a++) {
                double turns = (double)f[a] / (double)p->n[a];
                w[a] = 2.0 * M_PI * (turns > 0.5 ? turns - 1.0 : turns);
                phase += w[a] * (double)at[a];
            }
            double form =
                c[0] * w[0] * w[0] + c[3] * w[1] * w[1] + c[5] * w[2] * w[2] +
                2.0 * (c[1] * w[0] * w[1] + c[2] * w[0] * w[2] + c[4] * w[1] * w[2]);
            kernel[d] += exp(-0.5 * form) * cos(phase) / (double)p->size;
        }
    }
    for (size_t r = 0; r < p->size; r++)
        for (size_t i = 0; i < p->size; i++) {
            size_t d[3];
            size_t stride[3] = {1, p->n[0], p->n[0] * p->n[1]};
            for (int a = 0; a < 3; a++)
                d[a] = (r / stride[a] % p->n[a] + p->n[a] - i / stride[a] % p->n[a]) %
                       p->n[a];
            p->k[r * p->size + i] = kernel[(d[2] * p->n[1] + d[1]) * p->n[0] + d[0]];
        }
}

static struct admm *make(const struct admm_config *cfg, size_t threads,
                         struct pool **pool)
{
    struct admm_config own = *cfg;
    struct admm *a = NULL;
    assert_int_equal(pool_create(pool, threads), 0);
    own.pool = *pool;
    assert_int_equal(admm_create(&a, &own), 0);
    return a;
}

/* Odd lengths: no frequency stands for both of its signs. */
static const struct admm_config small = {
    .n = {5, 3, 7}, .rho = 0.1, .iterations = 3000, .tolerance = 1e-6};

static void fill(double *b, size_t n)
{
    unsigned long long seed = 11;
    for (size_t i = 0; i < n; i++)
        b[i] = 0.1 * reference_random(&seed) + (i % 41 == 3) + 0.7 * (i / 15 % 4 == 1);
}

static void to_float(const double *b, size_t n, float *out)
{
    for (size_t i = 0; i < n; i++)
        out[i] = (float)b[i];
}

static void expect_optimum(double l1, double tv, bool isotropic)
{
    static double k[N_MAX * N_MAX];
    double b[N_MAX], expected[N_MAX], got[N_MAX];
    float data[N_MAX], x[N_MAX];
    struct problem p = {.n = {5, 3, 7},
                        .size = 105,
                        .n_data = 105,
                        .k = k,
                        .b = b,
                        .wrap = true,
                        .isotropic = isotropic};
    struct admm_config cfg = small;
    struct admm_result r;
    struct pool *pool;
    fill(b, p.size);
    to_float(b, p.size, data);
    blur_matrix(&p, tilted);
    cfg.l1 = l1;
    cfg.tv = tv;
    cfg.tv_isotropic = isotropic;
    struct admm *a = make(&cfg, 2, &pool);
    admm_blur_gaussian(a, tilted);
    admm_solve(a, data, 1.0, x, &r);
    p.l1 = l1;
    p.tv = tv;
    assert_near(r.l1_weight, l1, 1e-6);
    assert_near(r.tv_weight, tv, 1e-6);
    solve(&p, 20000, expected);
    for (size_t i = 0; i < p.size; i++)
        got[i] = x[i];
    double best = objective(&p, expected);
    assert_near(objective(&p, got) / best, 1.0, 2e-5);
    assert_near(r.objective / best, 1.0, 1e-4);
    if (l1 > 0.0)
        for (size_t i = 0; i < p.size; i++)
            assert_near(got[i], expected[i], 0.06); /* what the blur hides is loose */
    admm_destroy(a);
    pool_destroy(pool);
}

static void the_optimum_is_that_of_an_independent_solver(void **state)
{
    (void)state;
    expect_optimum(0.05, 0.03, false);
    expect_optimum(0.05, 0.03, true);
    expect_optimum(0.05, 0.0, false);
}

static void without_blur_the_l1_weight_is_subtracted(void **state)
{
    (void)state;
    struct admm_config cfg = small;
    struct pool *pool;
    double b[N_MAX];
    float data[N_MAX], x[N_MAX];
    cfg.l1 = 0.2;
    struct admm *a = make(&cfg, 1, &pool);
    fill(b, 105);
    to_float(b, 105, data);
    admm_solve(a, data, 1.0, x, NULL);
    for (size_t i = 0; i < 105; i++)
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
        struct admm *a = make(&cfg, 3, &pool);
        admm_solve(a, b, 1.0, x, NULL);
        for (size_t i = 0; i < 40; i++)
            assert_near(x[i], i >= 8 && i < 24 ? 1.0 - 1.6 / 16.0 : 0.25 + 1.6 / 24.0,
                        1e-4);
        admm_destroy(a);
        pool_destroy(pool);
    }
}

/* -- any operator -----------------------------------------------------------------------
 */

static void dense_forward(void *ctx, const float *x, float *y)
{
    const struct problem *p = ctx;
    double in[N_MAX], out[N_MAX];
    for (size_t i = 0; i < p->size; i++)
        in[i] = x[i];
    multiply(p, in, out);
    to_float(out, p->n_data, y);
}

static void dense_adjoint(void *ctx, const float *y, float *x)
{
    const struct problem *p = ctx;
    for (size_t i = 0; i < p->size; i++) {
        double sum = 0.0;
        for (size_t r = 0; r < p->n_data; r++)
            sum += p->k[r * p->size + i] * (double)y[r];
        x[i] = (float)sum;
    }
}

/* Fewer data than voxels, edges that do not wrap, and a gain that is not 1. */
static void any_operator_reaches_its_optimum(void **state)
{
    (void)state;
    static double k[N_MAX * N_MAX];
    double b[N_MAX], expected[N_MAX], got[N_MAX];
    float data[N_MAX], x[N_MAX];
    unsigned long long seed = 5;
    struct problem p = {.n = {6, 4, 5}, .size = 120, .n_data = 90, .k = k, .b = b};
    for (size_t q = 0; q < p.n_data * p.size; q++)
        k[q] = (reference_random(&seed) - 0.3) / 90.0;
    for (size_t r = 0; r < p.n_data; r++)
        b[r] = 0.0;
    for (size_t r = 0; r < p.n_data; r++)
        for (size_t i = 40; i < 60; i++)
            b[r] += k[r * p.size + i] + 1e-3 * (reference_random(&seed) - 0.5);
    to_float(b, p.n_data, data);
    const struct admm_operator linear = {&p, dense_forward, dense_adjoint, p.n_data};
    const struct admm_config cfg = {.n = {6, 4, 5},
                                    .l1 = 0.01,
                                    .tv = 0.02,
                                    .rho = 0.1,
                                    .iterations = 4000,
                                    .tolerance = 1e-6,
                                    .linear = &linear};
    struct pool *pool;
    struct admm_result r;
    struct admm *a = make(&cfg, 2, &pool);
    admm_solve(a, data, 0.0, x, &r);
    p.l1 = r.l1_weight;
    p.tv = r.tv_weight;
    solve(&p, 20000, expected);
    for (size_t i = 0; i < p.size; i++)
        got[i] = x[i];
    double best = objective(&p, expected);
    print_message("it %zu conv %d pr %g du %g rho %g obj %g ref %g got %g\n",
                  r.iterations, r.converged, r.primal, r.dual, r.rho, r.objective, best,
                  objective(&p, got));
    assert_near(objective(&p, got) / best, 1.0, 1e-3);
    assert_near(r.objective / best, 1.0, 1e-3);
    admm_destroy(a);
    pool_destroy(pool);
}

/* -- hard cases -------------------------------------------------------------------------
 */

static void run(const struct admm_config *cfg, size_t threads, const float *b, float *x,
                struct admm_result *r)
{
    struct pool *pool;
    struct admm *a = make(cfg, threads, &pool);
    admm_blur_gaussian(a, tilted);
    admm_solve(a, b, 0.0, x, r);
    for (size_t i = 0; i < 105; i++)
        assert_true(isfinite(x[i]) && x[i] >= 0.0f);
    assert_true(isfinite(r->objective) && isfinite(r->primal) && isfinite(r->dual));
    admm_destroy(a);
    pool_destroy(pool);
}

static void the_gain_of_the_data_only_scales_the_result(void **state)
{
    (void)state;
    static const double gains[4] = {0.03, 30.0, 1e-12, 1e12};
    struct admm_config cfg = small;
    struct admm_result r;
    double b[N_MAX];
    float data[N_MAX], one[N_MAX], x[N_MAX];
    cfg.l1 = 0.05;
    cfg.tv = 0.02;
    cfg.tolerance = 1e-4;
    fill(b, 105);
    to_float(b, 105, data);
    run(&cfg, 1, data, one, &r);
    for (int g = 0; g < 4; g++) {
        for (size_t i = 0; i < 105; i++)
            data[i] = (float)(b[i] * gains[g]);
        run(&cfg, 1, data, x, &r);
        for (size_t i = 0; i < 105; i++)
            assert_near(x[i] / gains[g], one[i], 1e-4);
    }
}

static void rho_changes_the_way_and_not_the_goal(void **state)
{
    (void)state;
    struct admm_config cfg = small;
    struct admm_result r, first;
    double b[N_MAX];
    float data[N_MAX], x[N_MAX];
    fill(b, 105);
    to_float(b, 105, data);
    for (int weights = 0; weights < 2; weights++) {
        cfg.l1 = weights ? 0.05 : 0.0;
        cfg.tv = weights ? 0.02 : 0.0;
        cfg.rho = 0.1;
        run(&cfg, 1, data, x, &first);
        for (double rho = 1e-3; rho < 2e3; rho *= 10.0) {
            cfg.rho = rho;
            run(&cfg, 1, data, x, &r);
            if (weights)
                assert_near(r.objective / first.objective, 1.0, 1e-4);
        }
    }
}

static void silence_constants_and_spikes_stay_finite(void **state)
{
    (void)state;
    static const double weights[4][2] = {{0, 0}, {0.05, 0}, {0, 0.05}, {0.05, 0.05}};
    for (int kind = 0; kind < 4; kind++) {
        for (int w = 0; w < 8; w++) {
            struct admm_config cfg = small;
            struct admm_result r;
            float b[N_MAX] = {0}, x[N_MAX];
            cfg.iterations = 200;
            cfg.l1 = weights[w / 2][0];
            cfg.tv = weights[w / 2][1];
            cfg.tv_isotropic = w % 2;
            for (size_t i = 0; i < 105; i++)
                b[i] = kind == 1 ? 0.7f : kind == 3 ? 1e-41f : 0.0f;
            if (kind == 2)
                b[100] = 5.0f;
            run(&cfg, 2, b, x, &r);
            for (size_t i = 0; i < 105; i++) {
                if (kind == 0 || kind == 3)
                    assert_true(x[i] == 0.0f);
                if (kind == 1) /* no blur and no edge in it: the weight is taken off */
                    assert_near(x[i], 0.7 * (1.0 - cfg.l1), 2e-3);
            }
        }
    }
}

static void weights_from_1_on_leave_nothing(void **state)
{
    (void)state;
    struct admm_config cfg = small;
    struct admm_result r;
    double b[N_MAX];
    float data[N_MAX], x[N_MAX];
    cfg.l1 = 1.0;
    cfg.tv = 0.1;
    fill(b, 105);
    to_float(b, 105, data);
    run(&cfg, 1, data, x, &r);
    assert_true(r.converged);
    for (size_t i = 0; i < 105; i++)
        assert_true(x[i] == 0.0f);
    cfg.l1 = 0.9;
    cfg.tv = 0.0;
    run(&cfg, 1, data, x, &r);
    float most = 0.0f;
    for (size_t i = 0; i < 105; i++)
        most = fmaxf(most, x[i]);
    assert_true(most > 0.0f);
}

static void threads_do_not_change_the_result(void **state)
{
    (void)state;
    struct admm_config cfg = small;
    struct admm_result r[2];
    double b[N_MAX];
    float data[N_MAX], x[2][N_MAX];
    cfg.l1 = cfg.tv = 0.03;
    fill(b, 105);
    to_float(b, 105, data);
    for (size_t t = 0; t < 2; t++)
        run(&cfg, 1 + 3 * t, data, x[t], &r[t]);
    assert_memory_equal(x[0], x[1], 105 * sizeof(float));
    assert_int_equal(r[0].iterations, r[1].iterations);
}

/* A measured kernel: the Gaussian's own, with its voxel 0 first. */
static void a_kernel_blurs_like_the_gaussian_that_it_is(void **state)
{
    (void)state;
    static double k[N_MAX * N_MAX];
    struct problem p = {.n = {5, 3, 7}, .size = 105, .n_data = 105, .k = k};
    struct admm_config cfg = small;
    struct pool *pool;
    struct admm_result r;
    double b[N_MAX];
    float data[N_MAX], kernel[N_MAX], gaussian[N_MAX], x[N_MAX];
    cfg.l1 = cfg.tv = 0.03;
    fill(b, 105);
    to_float(b, 105, data);
    run(&cfg, 1, data, gaussian, &r);
    blur_matrix(&p, tilted);
    for (size_t d = 0; d < 105; d++)
        kernel[d] = (float)(3.0 * k[d * 105]); /* and thrice as strong */
    struct admm *a = make(&cfg, 1, &pool);
    admm_blur_kernel(a, kernel);
    admm_solve(a, data, 0.0, x, NULL);
    for (size_t i = 0; i < 105; i++)
        assert_near(3.0 * x[i], gaussian[i], 1e-3);
    admm_destroy(a);
    pool_destroy(pool);
}

static void the_stopping_rule_stops(void **state)
{
    (void)state;
    struct admm_config cfg = small;
    struct admm_result r;
    double b[N_MAX];
    float data[N_MAX], x[N_MAX];
    size_t before = 0;
    cfg.l1 = cfg.tv = 0.03;
    fill(b, 105);
    to_float(b, 105, data);
    for (double tolerance = 1e-2; tolerance > 1e-6; tolerance *= 0.1) {
        cfg.tolerance = tolerance;
        run(&cfg, 1, data, x, &r);
        assert_true(r.converged && r.primal <= tolerance && r.dual <= tolerance);
        assert_true(r.iterations >= before && r.iterations < cfg.iterations);
        before = r.iterations;
    }
    cfg.iterations = 3;
    run(&cfg, 1, data, x, &r);
    assert_false(r.converged);
    assert_int_equal(r.iterations, 3);
}

static void nonsense_is_refused(void **state)
{
    (void)state;
    struct pool *pool;
    struct admm *a = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    for (int q = 0; q < 6; q++) {
        struct admm_config cfg = small;
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
        cmocka_unit_test(the_gain_of_the_data_only_scales_the_result),
        cmocka_unit_test(rho_changes_the_way_and_not_the_goal),
        cmocka_unit_test(silence_constants_and_spikes_stay_finite),
        cmocka_unit_test(weights_from_1_on_leave_nothing),
        cmocka_unit_test(threads_do_not_change_the_result),
        cmocka_unit_test(a_kernel_blurs_like_the_gaussian_that_it_is),
        cmocka_unit_test(the_stopping_rule_stops),
        cmocka_unit_test(nonsense_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
