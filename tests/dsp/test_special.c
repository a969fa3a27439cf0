/* SPDX-License-Identifier: MIT */
/* Against closed forms that are sums of few positive terms, or textbook values. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "dsp/special.h"

#define EXACT 1e-10

static void assert_close(double value, double expected)
{
    if (!(fabs(value - expected) <= EXACT * fabs(expected)))
        fail_msg("%.17g instead of %.17g", value, expected);
}

/* Q(n, x) = exp(-x) sum over k < n of x^k / k! */
static double erlang(int n, double x)
{
    double term = exp(-x), sum = 0.0;

    for (int k = 0; k < n; k++) {
        sum += term;
        term *= x / (k + 1);
    }
    return sum;
}

/* Of `of` trials that each succeed by `chance`, at least `least` do: the terms'
 * logarithms by sums, no gamma function. */
static double at_least(int least, int of, double chance)
{
    double sum = 0.0;

    for (int k = least; k <= of; k++) {
        double log_term = k * log(chance) + (of - k) * log1p(-chance);
        for (int i = 1; i <= of - k; i++)
            log_term += log((double)(k + i) / i);
        sum += exp(log_term);
    }
    return sum;
}

static void gamma_of_whole_shapes_is_a_poisson_sum(void **state)
{
    static const double x[] = {1e-12, 1e-3, 0.7, 1.0, 2.5, 10.0, 64.0, 90.0, 300.0};

    (void)state;
    for (int n = 1; n <= 64; n += 3)
        for (unsigned i = 0; i < sizeof x / sizeof *x; i++)
            assert_close(special_gamma_q(n, x[i]), erlang(n, x[i]));
    assert_true(special_gamma_q(3.0, 0.0) == 1.0 && special_gamma_q(3.0, -1.0) == 1.0);
}

/* Q(a + 1, x) = Q(a, x) + x^a exp(-x) / Gamma(a + 1), from Q(1/2, x) = erfc(sqrt x). */
static void gamma_of_half_shapes_is_the_normal_tail(void **state)
{
    (void)state;
    for (double x = 0.01; x < 200.0; x *= 1.7) {
        double expected = erfc(sqrt(x)), step = sqrt(x / M_PI) * exp(-x) * 2.0;
        for (double a = 0.5; a < 40.0; a += 1.0) {
            assert_close(special_gamma_q(a, x), expected);
            expected += step;
            step *= x / (a + 1.0);
        }
    }
}

static void beta_of_whole_shapes_is_a_binomial_tail(void **state)
{
    static const double x[] = {1e-6, 0.02, 0.3, 0.5, 0.75, 0.99};

    (void)state;
    for (int a = 1; a <= 400; a += 57)
        for (int b = 1; b <= 400; b += 57)
            for (unsigned i = 0; i < sizeof x / sizeof *x; i++) {
                double p = at_least(a, a + b - 1, x[i]);
                double q = at_least(b, a + b - 1, 1.0 - x[i]);
                if (p > 1e-290)
                    assert_close(special_beta_p(x[i], a, b), p);
                if (q > 1e-290)
                    assert_close(special_beta_q(x[i], a, b), q);
            }
}

/* B(1, b) and B(a, 1) have closed forms for every b and a. */
static void beta_of_broken_shapes_is_a_power(void **state)
{
    (void)state;
    for (double b = 0.2; b < 50000.0; b *= 3.1)
        for (double x = 1e-5; x < 1.0; x *= 2.3) {
            if (pow(1.0 - x, b) > 1e-290)
                assert_close(special_beta_q(x, 1.0, b), pow(1.0 - x, b));
            assert_close(special_beta_p(x, 1.0, b), -expm1(b * log1p(-x)));
            if (pow(x, b) > 1e-290)
                assert_close(special_beta_p(x, b, 1.0), pow(x, b));
        }
    assert_true(special_beta_p(0.0, 2.0, 3.0) == 0.0 &&
                special_beta_p(1.0, 2.0, 3.0) == 1.0);
    assert_true(special_beta_q(0.0, 2.0, 3.0) == 1.0 &&
                special_beta_q(1.0, 2.0, 3.0) == 0.0);
}

static void the_density_is_that_of_an_ordered_uniform(void **state)
{
    (void)state;
    for (int n = 1; n <= 60; n += 7)
        for (int k = 1; k <= n; k++)
            for (double x = 0.05; x < 1.0; x += 0.18) {
                double density = n;
                for (int i = 1; i < k; i++)
                    density *= x * (n - i) / i;
                for (int i = k; i < n; i++)
                    density *= 1.0 - x;
                assert_close(special_beta_density(x, k, n + 1 - k), density);
            }
    assert_true(special_beta_density(0.0, 2.0, 3.0) == 0.0);
}

static void digamma_is_right_at_one_and_a_half_and_recurs(void **state)
{
    const double euler = 0.57721566490153286061;

    (void)state;
    assert_close(special_digamma(1.0), -euler);
    assert_close(special_digamma(0.5), -euler - 2.0 * log(2.0));
    for (double x = 0.21; x < 64.0; x *= 1.3)
        assert_true(fabs(special_digamma(x + 1.0) - special_digamma(x) - 1.0 / x) <
                    1e-12 * (1.0 + 1.0 / x));
    double whole = -euler;
    for (int n = 1; n < 30; n++) {
        whole += 1.0 / n;
        assert_close(special_digamma(n + 1.0), whole);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gamma_of_whole_shapes_is_a_poisson_sum),
        cmocka_unit_test(gamma_of_half_shapes_is_the_normal_tail),
        cmocka_unit_test(beta_of_whole_shapes_is_a_binomial_tail),
        cmocka_unit_test(beta_of_broken_shapes_is_a_power),
        cmocka_unit_test(the_density_is_that_of_an_ordered_uniform),
        cmocka_unit_test(digamma_is_right_at_one_and_a_half_and_recurs),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
