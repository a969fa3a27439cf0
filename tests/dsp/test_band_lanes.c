/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "dsp/band_transform.h"

static const struct band_transform_config sizes[] = {
    {4201, {2.0 / 48.0, 20.0 / 48.0}, 2.0, 912.0, 0.0}, /* a ping */
    {300, {0.1, 0.3}, 1.0, 299.0, 0.0},                 /* no room above the band */
    {1000, {0.0, 0.5}, 1.5, 10.0, 0.0},
    {17, {0.2, 0.25}, 4.0, 0.0, 0.0},
    {1, {0.0, 0.5}, 1.0, 0.5, 0.0},
};
#define N_SIZES (sizeof(sizes) / sizeof(*sizes))

struct rig {
    struct band_plan plan;
    struct band_lanes *lanes;
    size_t n, stride, n_bins;
    float *x;              /* [16][stride] */
    float complex *filter; /* [16][n_bins] */
    float *filters;        /* of all lanes */
    float complex *y;      /* [16][n_output] */
};

static float random_value(unsigned *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return (float)(*seed >> 8) / 8388608.0f - 1.0f;
}

static double complex turn(double cycles)
{
    return cexp(2.0 * M_PI * I * (cycles - floor(cycles)));
}

static void rig_make(struct rig *r, const struct band_transform_config *c, size_t n)
{
    unsigned seed = 3;
    size_t n_output;

    assert_int_equal(band_plan_init(&r->plan, c), 0);
    assert_int_equal(band_lanes_create(&r->lanes, &r->plan), 0);
    n_output = r->plan.layout.n_output;
    r->n = n ? n : r->plan.layout.length;
    r->stride = r->n + 3;
    r->n_bins = r->plan.layout.n_streams * r->plan.layout.n_bins;
    r->x = malloc(VECTOR_LANES * r->stride * sizeof(*r->x));
    r->filter = malloc(VECTOR_LANES * r->n_bins * sizeof(*r->filter));
    r->filters = malloc(r->n_bins * BAND_LANES_POINT * sizeof(*r->filters));
    r->y = malloc(VECTOR_LANES * n_output * sizeof(*r->y));
    assert_true(r->x && r->filter && r->filters && r->y);
    for (size_t i = 0; i < VECTOR_LANES * r->stride; i++)
        r->x[i] = random_value(&seed);
    for (size_t i = 0; i < VECTOR_LANES * r->n_bins; i++)
        r->filter[i] = random_value(&seed) + I * random_value(&seed);
    for (size_t i = 0; i < VECTOR_LANES; i++)
        band_lanes_filter(&r->plan, r->filters, i, r->filter + i * r->n_bins);
    for (size_t i = 0; i < VECTOR_LANES * n_output; i++)
        r->y[i] = NAN;
}

static void rig_clear(struct rig *r)
{
    band_lanes_destroy(r->lanes);
    band_plan_clear(&r->plan);
    free(r->x);
    free(r->filter);
    free(r->filters);
    free(r->y);
}

/* A frequency of stream b / n, bin b % n, as the plan documents it. */
static double frequency(const struct band_plan *p, size_t b)
{
    size_t n = p->layout.n_bins;
    size_t k = p->layout.n_streams * (p->first + b % n) + b / n;

    return ((double)k + 0.5) / (double)p->layout.length;
}

/* A channel's trace is the sums that define it, in double precision. */
static void check_channel(const struct rig *r, size_t channel, size_t filter)
{
    const struct band_transform_layout *l = &r->plan.layout;
    const float *x = r->x + channel * r->stride;
    double complex *bins = malloc(r->n_bins * sizeof(*bins));
    double weight = 0.0;

    assert_non_null(bins);
    for (size_t b = 0; b < r->n_bins; b++) {
        double complex step = turn(-frequency(&r->plan, b)), phase = 1.0, sum = 0.0;
        for (size_t j = 0; j < r->n; j++, phase *= step)
            sum += x[j] * phase;
        bins[b] = sum * r->filter[filter * r->n_bins + b];
        weight += cabs(bins[b]);
    }
    for (size_t t = 0; t < l->n_output; t += 1 + l->n_output / 9) {
        double complex sum = 0.0;
        for (size_t b = 0; b < r->n_bins; b++)
            sum += bins[b] *
                   turn((frequency(&r->plan, b) - l->carrier) * (double)t / l->rate);
        assert_true(cabs(sum - r->y[channel * l->n_output + t]) < 1e-6 * weight + 1e-6);
    }
    free(bins);
}

static void each_channel_goes_through_its_own_filter(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_SIZES; i++) {
        struct rig r;

        rig_make(&r, &sizes[i], i % 2 ? 0 : sizes[i].n_min);
        band_lanes_execute(r.lanes, r.x, r.stride, r.n, r.filters, false, r.y,
                           VECTOR_LANES);
        for (size_t c = 0; c < VECTOR_LANES; c += 5)
            check_channel(&r, c, c);
        rig_clear(&r);
    }
}

static void one_filter_serves_all_channels(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_SIZES; i++) {
        struct rig r;

        rig_make(&r, &sizes[i], i % 2 ? 0 : sizes[i].n_min);
        band_lanes_execute(r.lanes, r.x, r.stride, r.n, (const float *)r.filter, true,
                           r.y, VECTOR_LANES);
        for (size_t c = 1; c < VECTOR_LANES; c += 7)
            check_channel(&r, c, 0);
        rig_clear(&r);
    }
}

static void lanes_without_a_channel_write_nothing(void **state)
{
    struct rig r;

    (void)state;
    rig_make(&r, &sizes[1], 0);
    for (size_t n = 1; n < VECTOR_LANES; n += 6) {
        band_lanes_execute(r.lanes, r.x, r.stride, r.n, r.filters, false, r.y, n);
        check_channel(&r, n - 1, n - 1);
        for (size_t i = n * r.plan.layout.n_output;
             i < VECTOR_LANES * r.plan.layout.n_output; i++)
            assert_true(isnan(crealf(r.y[i])));
    }
    rig_clear(&r);
}

static void a_channel_that_is_no_number_stays_alone(void **state)
{
    struct rig r;

    (void)state;
    rig_make(&r, &sizes[0], 0);
    r.x[4 * r.stride + 100] = NAN;
    band_lanes_execute(r.lanes, r.x, r.stride, r.n, r.filters, false, r.y, VECTOR_LANES);
    for (size_t i = 0; i < r.plan.layout.n_output; i++)
        for (size_t c = 0; c < VECTOR_LANES; c++)
            assert_true(isnan(crealf(r.y[c * r.plan.layout.n_output + i])) == (c == 4));
    rig_clear(&r);
}

static void nothing_is_left_of_the_last_run(void **state)
{
    struct rig r;
    size_t n_output;

    (void)state;
    rig_make(&r, &sizes[0], 4000);
    n_output = r.plan.layout.n_output;
    band_lanes_execute(r.lanes, r.x, r.stride, r.n, r.filters, false, r.y, VECTOR_LANES);
    for (size_t i = 0; i < VECTOR_LANES * r.stride; i++)
        r.x[i] = 0.0f;
    band_lanes_execute(r.lanes, r.x, r.stride, 1, r.filters, false, r.y, VECTOR_LANES);
    for (size_t i = 0; i < VECTOR_LANES * n_output; i++)
        assert_true(r.y[i] == 0.0f);
    rig_clear(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_channel_goes_through_its_own_filter),
        cmocka_unit_test(one_filter_serves_all_channels),
        cmocka_unit_test(lanes_without_a_channel_write_nothing),
        cmocka_unit_test(a_channel_that_is_no_number_stays_alone),
        cmocka_unit_test(nothing_is_left_of_the_last_run),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
