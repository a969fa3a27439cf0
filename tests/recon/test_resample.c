/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>

#include "recon/imaging/resample.h"

static struct pool *pool;

static const struct grid from = {{-0.2, 0.1, 1.0}, {0.05, 0.04, 0.02}, {9, 7, 11}};

/* Trilinear functions are what trilinear interpolation keeps. */
static double field(double x, double y, double z)
{
    return 1.0 + 2.0 * x - 3.0 * y + 0.5 * z + 4.0 * x * y - y * z + 7.0 * x * y * z;
}

static void coordinates(const struct grid *g, size_t v, double p[3])
{
    const size_t i[3] = {v % g->n[0], v / g->n[0] % g->n[1], v / (g->n[0] * g->n[1])};
    for (int a = 0; a < 3; a++)
        p[a] = g->origin_m[a] + g->step_m[a] * (double)i[a];
}

static float *sample(const struct grid *g)
{
    float *x = malloc(grid_size(g) * sizeof *x);
    assert_non_null(x);
    for (size_t v = 0; v < grid_size(g); v++) {
        double p[3];
        coordinates(g, v, p);
        x[v] = (float)field(p[0], p[1], p[2]);
    }
    return x;
}

static float *resample(const struct grid *a, const struct grid *b, enum resample_way way,
                       const float *in)
{
    struct resample *r = NULL;
    float *out = malloc(grid_size(b) * sizeof *out);
    assert_non_null(out);
    assert_int_equal(resample_create(&r, a, b, way, pool), 0);
    resample_volume(r, in, out);
    resample_destroy(r);
    return out;
}

static void trilinear_functions_are_kept_inside_and_nothing_is_outside(void **state)
{
    (void)state;
    const struct grid to = {{-0.31, 0.02, 0.93}, {0.037, 0.023, 0.013}, {20, 17, 29}};
    float *in = sample(&from), *out = resample(&from, &to, RESAMPLE_LINEAR, in);
    size_t inside = 0;
    for (size_t v = 0; v < grid_size(&to); v++) {
        double p[3];
        int within = 1;
        coordinates(&to, v, p);
        for (int a = 0; a < 3; a++) {
            double last = from.origin_m[a] + from.step_m[a] * (double)(from.n[a] - 1);
            within = within && p[a] >= from.origin_m[a] && p[a] <= last;
        }
        assert_near(out[v], within ? field(p[0], p[1], p[2]) : 0.0, 2e-6);
        inside += (size_t)within;
    }
    assert_true(inside > 1000 && inside < grid_size(&to));
    free(in);
    free(out);
}

/* Cubic convolution keeps parabolas, but for the outermost cells. */
static void parabolas_are_kept_by_the_cubic_way(void **state)
{
    (void)state;
    const struct grid line = {{1.0, 0.0, 0.0}, {0.5, 1.0, 1.0}, {9, 1, 1}};
    const struct grid to = {{1.5, 0.0, 0.0}, {0.0375, 1.0, 1.0}, {81, 1, 1}};
    float in[9];
    for (int i = 0; i < 9; i++) {
        double x = 1.0 + 0.5 * i;
        in[i] = (float)(2.0 - 3.0 * x + 0.7 * x * x);
    }
    float *out = resample(&line, &to, RESAMPLE_CUBIC, in);
    for (int i = 0; i < 81; i++) {
        double x = 1.5 + 0.0375 * i;
        assert_near(out[i], 2.0 - 3.0 * x + 0.7 * x * x, 1e-5);
    }
    free(out);
}

static void a_peak_between_voxels_is_found_by_the_cubic_way(void **state)
{
    (void)state;
    const struct grid coarse = {{0.0, 0.0, 0.0}, {1.0, 1.0, 1.0}, {15, 13, 1}};
    const struct grid fine = {{0.0, 0.0, 0.0}, {0.05, 0.05, 1.0}, {281, 241, 1}};
    float in[15 * 13];
    size_t best = 0;
    for (int v = 0; v < 15 * 13; v++) {
        double x = v % 15 - 7.3, y = v / 15 - 5.6;
        in[v] = (float)exp(-0.5 * (x * x + y * y) / 4.0);
    }
    float *out = resample(&coarse, &fine, RESAMPLE_CUBIC, in);
    for (size_t v = 0; v < grid_size(&fine); v++)
        best = out[v] > out[best] ? v : best;
    assert_near((double)(best % 281) * 0.05, 7.3, 0.11);
    assert_near((double)(best / 281) * 0.05, 5.6, 0.11);
    free(out);
}

static void the_same_lattice_is_a_copy(void **state)
{
    (void)state;
    float *in = sample(&from);
    for (int way = RESAMPLE_LINEAR; way <= RESAMPLE_CUBIC; way++) {
        float *out = resample(&from, &from, (enum resample_way)way, in);
        for (size_t v = 0; v < grid_size(&from); v++)
            assert_near(out[v], in[v], 2e-6);
        free(out);
    }
    free(in);
}

static void an_axis_of_one_voxel_is_as_thick_as_its_step(void **state)
{
    (void)state;
    const struct grid flat = {{0.0, 0.0, 1.0}, {0.1, 0.1, 0.1}, {1, 1, 1}};
    const struct grid to = {{0.0, 0.0, 0.9}, {0.1, 0.1, 0.04}, {1, 1, 6}};
    const float one = 1.0f, expected[6] = {0, 0, 1, 1, 0, 0}; /* 0.98, 1.02 */
    for (int way = RESAMPLE_LINEAR; way <= RESAMPLE_CUBIC; way++) {
        float *out = resample(&flat, &to, (enum resample_way)way, &one);
        for (size_t v = 0; v < 6; v++)
            assert_near(out[v], expected[v], 0.0);
        free(out);
    }
}

static void values_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    struct resample *r = NULL;
    struct grid bad = from;
    bad.n[1] = 0;
    assert_int_equal(resample_create(&r, &bad, &from, RESAMPLE_LINEAR, pool), -EINVAL);
    bad = from;
    bad.step_m[2] = NAN;
    assert_int_equal(resample_create(&r, &from, &bad, RESAMPLE_LINEAR, pool), -EINVAL);
    assert_int_equal(resample_create(&r, &from, &from, RESAMPLE_CUBIC, NULL), -EINVAL);
    assert_null(r);
    resample_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trilinear_functions_are_kept_inside_and_nothing_is_outside),
        cmocka_unit_test(parabolas_are_kept_by_the_cubic_way),
        cmocka_unit_test(a_peak_between_voxels_is_found_by_the_cubic_way),
        cmocka_unit_test(the_same_lattice_is_a_copy),
        cmocka_unit_test(an_axis_of_one_voxel_is_as_thick_as_its_step),
        cmocka_unit_test(values_that_make_no_sense_are_refused),
    };
    if (pool_create(&pool, 2))
        return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    pool_destroy(pool);
    return failed;
}
