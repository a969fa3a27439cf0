/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dsp/band_transform.h"
#include "tests/dsp/near.h"

static const struct band_transform_config sizes[] = {
    {4201, {2.0 / 48.0, 20.0 / 48.0}, 2.0, 912.0, 0.0}, /* a ping */
    {300, {0.1, 0.3}, 1.0, 299.0, 0.0},
    {1000, {0.0, 0.5}, 1.5, 10.0, 0.0},
    {17, {0.2, 0.25}, 4.0, 0.0, 0.0},
    {1, {0.0, 0.5}, 1.0, 0.5, 0.0},
    {9000, {0.01, 0.02}, 3.0, 8000.0, 0.0},
};
#define N_SIZES (sizeof(sizes) / sizeof(*sizes))

static double random_value(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (double)(*seed >> 8) / 8388608.0 - 1.0;
}

static double complex turn(double cycles)
{
    return cexp(2.0 * M_PI * I * (cycles - floor(cycles)));
}

static void the_layout_covers_band_and_span(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_SIZES; i++) {
        const struct band_transform_config *c = &sizes[i];
        struct band_transform_layout l;
        struct band_transform *bt;
        double bin;

        assert_int_equal(band_transform_create(&bt, c), 0);
        band_transform_layout(bt, &l);
        bin = 1.0 / (double)l.length;
        assert_true(l.length >= c->n_min);
        assert_true(band_transform_frequency(bt, 0, 0) <= c->band[0] + bin);
        assert_true(band_transform_frequency(bt, l.n_streams - 1, l.n_bins - 1) >=
                    c->band[1] - bin);
        assert_true(l.rate >= c->oversampling * (c->band[1] - c->band[0] - bin));
        assert_true(l.carrier > c->band[0] && l.carrier < c->band[1]);
        assert_true((double)(l.n_output - 1) <= c->span * l.rate + 1e-3);
        assert_true((double)l.n_output > c->span * l.rate);
        band_transform_destroy(bt);
    }
}

static void bins_are_those_of_the_sum_that_defines_them(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_SIZES; i++) {
        struct band_transform_layout l;
        struct band_transform *bt;
        unsigned seed = 1;
        float *x;
        size_t n;

        assert_int_equal(band_transform_create(&bt, &sizes[i]), 0);
        band_transform_layout(bt, &l);
        n = i % 2 ? l.length : sizes[i].n_min; /* rows that end anywhere */
        x = calloc(n, sizeof(*x));
        assert_non_null(x);
        for (size_t j = 0; j < n; j++)
            x[j] = (float)random_value(&seed);
        band_transform_forward(bt, x, n);
        for (size_t b = 0; b < l.n_streams * l.n_bins; b += 1 + l.n_bins / 7) {
            size_t stream = b / l.n_bins, bin = b % l.n_bins;
            double f = band_transform_frequency(bt, stream, bin);
            double complex sum = 0.0;
            for (size_t j = 0; j < n; j++)
                sum += x[j] * turn(-f * (double)j);
            assert_true(cabs(sum - band_transform_bin(bt, stream, bin)) <
                        1e-6 * (double)n + 1e-6);
        }
        free(x);
        band_transform_destroy(bt);
    }
}

static void the_way_back_is_the_sum_that_defines_it(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_SIZES; i++) {
        struct band_transform_layout l;
        struct band_transform *bt;
        unsigned seed = 2;
        float complex *filter, *y;
        double weight = 0.0;
        float *x;
        size_t n;

        assert_int_equal(band_transform_create(&bt, &sizes[i]), 0);
        band_transform_layout(bt, &l);
        n = l.n_streams * l.n_bins;
        x = calloc(sizes[i].n_min, sizeof(*x));
        filter = calloc(n, sizeof(*filter));
        y = calloc(l.n_output, sizeof(*y));
        assert_true(x && filter && y);
        for (size_t j = 0; j < sizes[i].n_min; j++)
            x[j] = (float)random_value(&seed);
        for (size_t j = 0; j < n; j++)
            filter[j] = (float)random_value(&seed) + I * (float)random_value(&seed);
        band_transform_forward(bt, x, sizes[i].n_min);
        band_transform_inverse(bt, filter, y);
        for (size_t b = 0; b < n; b++)
            weight += cabs((double complex)filter[b] *
                           band_transform_bin(bt, b / l.n_bins, b % l.n_bins));
        for (size_t t = 0; t < l.n_output; t += 1 + l.n_output / 9) {
            double complex sum = 0.0;
            for (size_t b = 0; b < n; b++) {
                size_t stream = b / l.n_bins, bin = b % l.n_bins;
                double f = band_transform_frequency(bt, stream, bin) - l.carrier;
                sum += (double complex)filter[b] * band_transform_bin(bt, stream, bin) *
                       turn(f * (double)t / l.rate);
            }
            assert_true(cabs(sum - y[t]) < 1e-6 * weight + 1e-6);
        }
        free(x);
        free(filter);
        free(y);
        band_transform_destroy(bt);
    }
}

static void nonsense_is_refused(void **state)
{
    struct band_transform *bt = NULL;
    struct band_transform_config c;

    (void)state;
#define REFUSED(field, value)                                                            \
    do {                                                                                 \
        c = sizes[0];                                                                    \
        c.field = (value);                                                               \
        assert_int_equal(band_transform_create(&bt, &c), -EINVAL);                       \
    } while (0)
    REFUSED(n_min, 0);
    REFUSED(n_min, (size_t)1 << 27);
    REFUSED(band[0], -0.1);
    REFUSED(band[0], 0.45);
    REFUSED(band[1], 0.51);
    REFUSED(band[1], NAN);
    REFUSED(oversampling, 0.5);
    REFUSED(span, -1.0);
    REFUSED(span, 4201.0);
#undef REFUSED
    assert_int_equal(band_transform_create(NULL, &sizes[0]), -EINVAL);
    assert_null(bt);
    band_transform_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_layout_covers_band_and_span),
        cmocka_unit_test(bins_are_those_of_the_sum_that_defines_them),
        cmocka_unit_test(the_way_back_is_the_sum_that_defines_it),
        cmocka_unit_test(nonsense_is_refused),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
