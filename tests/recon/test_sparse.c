/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>
#include <stdlib.h>
#include <string.h>

#include "recon/inverse/sparse_operator.h"
#include "tests/recon/rig.h"
#include "tests/recon/turntable.h"

struct bench { /* an operator over the rig, and points in it */
    struct rig r;
    struct pool *pool;
    struct sparse_operator *k;
    size_t n, n_traces, n_samples;
    double (*at_m)[3];
    float *x, *z;
    float complex *y;
};

static void draw(float *x, size_t n, unsigned long long seed)
{
    for (size_t i = 0; i < n; i++)
        x[i] = (float)(reference_random(&seed) - 0.5);
}

static void bench_create(struct bench *b, size_t n, size_t threads, size_t pings)
{
    unsigned long long seed = 7;
    memset(b, 0, sizeof *b);
    rig_default(&b->r);
    const struct imager_config cfg = {.geometry = &b->r.geometry,
                                      .format = b->r.format,
                                      .band_hz = {2000.0, 20000.0},
                                      .pool = NULL};
    struct imager_config own = cfg;
    assert_int_equal(pool_create(&b->pool, threads), 0);
    own.pool = b->pool;
    assert_int_equal(sparse_operator_create(&b->k, &own, n), 0);
    b->n = n;
    b->n_traces = 8 * 4 * 4;
    b->n_samples = b->r.format.n_samples;
    b->at_m = malloc(n * sizeof *b->at_m);
    b->x = malloc(2 * n * sizeof *b->x);
    b->z = malloc(2 * n * sizeof *b->z);
    b->y = malloc(b->n_traces * b->n_samples * sizeof *b->y);
    float complex *ping = malloc(4 * b->n_samples * sizeof *ping);
    const struct scatterer point = {{0.01, -0.02, 1.1}, 1.0};
    for (size_t p = 0; p < pings; p++) {
        rig_ping(&b->r, p / 4, p % 4, &point, 1, ping);
        sparse_operator_add(b->k, p / 4, p % 4, ping, NULL);
    }
    free(ping);
    for (size_t v = 0; v < n; v++)
        for (int a = 0; a < 3; a++)
            b->at_m[v][a] = (a == 2 ? 1.1 : 0.0) + 0.3 * (reference_random(&seed) - 0.5);
    sparse_operator_place(b->k, n, (const double(*)[3])b->at_m);
}

static void bench_destroy(struct bench *b)
{
    sparse_operator_destroy(b->k);
    pool_destroy(b->pool);
    free(b->at_m);
    free(b->x);
    free(b->z);
    free(b->y);
}

static double complex dot(const float *a, const float *b, size_t n)
{
    double complex sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += conj((double)a[2 * i] + (double)a[2 * i + 1] * I) *
               ((double)b[2 * i] + (double)b[2 * i + 1] * I);
    return sum;
}

static void expect_adjoint(size_t threads, size_t pings)
{
    struct bench b;
    bench_create(&b, 40, threads, pings);
    size_t n = b.n_traces * b.n_samples;
    float *noise = malloc(2 * n * sizeof *noise);
    draw(b.x, 2 * b.n, 1);
    draw(noise, 2 * n, 2);
    sparse_operator_forward(b.k, b.x, b.y);
    sparse_operator_adjoint(b.k, (const float complex *)noise, b.z);
    double complex left = dot((const float *)b.y, noise, n), right = dot(b.x, b.z, b.n);
    double size = sqrt(creal(dot((const float *)b.y, (const float *)b.y, n)) *
                       creal(dot(noise, noise, n)));
    assert_true(cabs(left) > 1e-4 * size);
    assert_below(cabs(left - right) / size, 2e-7);
    free(noise);
    bench_destroy(&b);
}

static void forward_and_adjoint_pass_the_dot_product_test(void **state)
{
    (void)state;
    expect_adjoint(1, 32);
    expect_adjoint(3, 32);
    expect_adjoint(2, 13); /* pings that were never added count on neither side */
}

static void the_normal_operator_is_adjoint_after_forward(void **state)
{
    (void)state;
    struct bench b;
    bench_create(&b, 40, 2, 32);
    float *both = malloc(2 * b.n * sizeof *both);
    draw(b.x, 2 * b.n, 3);
    sparse_operator_forward(b.k, b.x, b.y);
    sparse_operator_adjoint(b.k, b.y, both);
    sparse_operator_normal(b.k, b.x, b.z);
    for (size_t i = 0; i < 2 * b.n; i++)
        assert_near(b.z[i], both[i], 1e-5);
    free(both);
    bench_destroy(&b);
}

static void the_gram_matrix_holds_the_normal_operator(void **state)
{
    (void)state;
    struct bench b;
    bench_create(&b, 40, 2, 32);
    float *gram = malloc(2 * b.n * b.n * sizeof *gram);
    sparse_operator_gram(b.k, gram);
    for (size_t v = 0; v < b.n; v += 7) {
        memset(b.x, 0, 2 * b.n * sizeof *b.x);
        b.x[2 * v] = 1.0f;
        sparse_operator_normal(b.k, b.x, b.z);
        assert_near(b.z[2 * v], 1.0, 5e-3); /* columns have length 1 */
        for (size_t i = 0; i < b.n; i++) {
            assert_near(gram[2 * i * b.n + v], b.z[2 * i], 5e-3);
            assert_near(gram[(2 * i + 1) * b.n + v], b.z[2 * i + 1], 5e-3);
        }
    }
    free(gram);
    bench_destroy(&b);
}

/* Up to the length of the column and the weight of a trace, both real and positive. */
static void a_point_sends_the_echoes_that_it_should(void **state)
{
    (void)state;
    struct bench b;
    bench_create(&b, 3, 1, 32);
    float complex *expected = malloc(4 * b.n_samples * sizeof *expected);
    const struct scatterer point = {{b.at_m[1][0], b.at_m[1][1], b.at_m[1][2]}, 1.0};
    memset(b.x, 0, 2 * b.n * sizeof *b.x);
    b.x[2] = 1.0f;
    sparse_operator_forward(b.k, b.x, b.y);
    for (size_t p = 0; p < 32; p += 5) {
        rig_ping(&b.r, p / 4, p % 4, &point, 1, expected);
        for (size_t i = 0; i < 4; i++) {
            const float complex *y = b.y + (p * 4 + i) * b.n_samples;
            const float complex *e = expected + i * b.n_samples;
            double complex cross = dot((const float *)e, (const float *)y, b.n_samples);
            double own = creal(dot((const float *)e, (const float *)e, b.n_samples));
            double it = creal(dot((const float *)y, (const float *)y, b.n_samples));
            assert_near(carg(cross), 0.0, 2e-3);
            assert_below(1.0 - cabs(cross) / sqrt(own * it), 1e-4);
        }
    }
    free(expected);
    bench_destroy(&b);
}

/* -- the method -------------------------------------------------------------------------
 */

/* Intensity within reach of a place, over that of all. */
static double share_near(const struct grid *grid, const float *image,
                         const double at_m[3], double reach_m)
{
    double near = 0.0, all = 0.0;
    for (size_t v = 0; v < grid_size(grid); v++) {
        size_t n[3] = {v % grid->n[0], v / grid->n[0] % grid->n[1],
                       v / (grid->n[0] * grid->n[1])};
        double p[3];
        for (int a = 0; a < 3; a++)
            p[a] = grid->origin_m[a] + grid->step_m[a] * (double)n[a];
        all += image[v];
        near += reference_distance(p, at_m) <= reach_m ? image[v] : 0.0f;
    }
    return all > 0.0 ? near / all : 0.0;
}

static void the_image_of_a_point_is_a_point(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    const struct scatterer point = {{0.012, -0.024, 1.105}, 1.0};
    float *image = rig_image(&r, "sparse", &point, 1, 2);
    assert_near(share_near(&r.grid, image, point.at_m, 1e-3), 1.0, 1e-3);
    free(image);
}

/* The rig resolves 7 cm across: lambda R / 2 D at the middle of the band. */
static void points_closer_than_the_diffraction_limit_come_apart(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    const struct scatterer points[2] = {{{-0.024, 0.0, 1.1}, 1.0},
                                        {{0.024, 0.0, 1.1}, 0.8}};
    float *image = rig_image(&r, "sparse", points, 2, 2);
    double first = share_near(&r.grid, image, points[0].at_m, 1e-3);
    double second = share_near(&r.grid, image, points[1].at_m, 1e-3);
    assert_near(first + second, 1.0, 1e-2);
    assert_near(second / first, 0.64, 0.05);
    free(image);
}

/* Pings with places of their own: 8 mm are half a wavelength here. */
static void a_turntable_tells_close_points_apart(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{0.004, 0.0, 0.004}, 1.0},
                                        {{-0.004, 0.004, 0.0}, 0.7}};
    const struct trace_format format = {0.0038, 44000.0, 20000.0, 140};
    struct turntable t;
    struct pool *pool;
    struct imager *im;
    turntable_default(&t);
    assert_int_equal(pool_create(&pool, 2), 0);
    struct imager_config cfg = {
        .method = "sparse",
        .geometry = &t.geometry,
        .format = format,
        .band_hz = {t.band_hz[0], t.band_hz[1]},
        .gate_m = {0.2, 2.0},
        .grid = {{-0.016, -0.016, -0.016}, {0.004, 0.004, 0.004}, {9, 9, 9}},
        .pool = pool,
    };
    float complex *traces = malloc(TURNTABLE_PINGS * format.n_samples * sizeof *traces);
    float *image = malloc(grid_size(&cfg.grid) * sizeof *image);
    assert_int_equal(imager_create(&im, &cfg, NULL), 0);
    turntable_traces(&t, &format, points, 2, traces);
    for (size_t k = 0; k < TURNTABLE_PINGS; k++)
        assert_true(imager_add(im, k, 0, traces + k * format.n_samples, NULL));
    imager_image(im, image);
    double first = share_near(&cfg.grid, image, points[0].at_m, 1e-3);
    double second = share_near(&cfg.grid, image, points[1].at_m, 1e-3);
    assert_near(first + second, 1.0, 1e-2);
    assert_near(second / first, 0.49, 0.05);
    imager_destroy(im);
    pool_destroy(pool);
    free(traces);
    free(image);
}

static float *image_with_gain(double gain)
{
    struct rig r;
    rig_default(&r);
    const struct scatterer points[2] = {{{-0.05, 0.0, 1.1}, gain},
                                        {{0.05, 0.02, 1.08}, 0.5 * gain}};
    return rig_image(&r, "sparse", points, 2, 1);
}

static void the_gain_of_the_recording_only_scales_it(void **state)
{
    (void)state;
    static const double gains[3] = {0.03, 30.0, 1e-12};
    struct rig r;
    rig_default(&r);
    size_t n = grid_size(&r.grid);
    float *one = image_with_gain(1.0);
    for (int g = 0; g < 3; g++) {
        float *other = image_with_gain(gains[g]);
        for (size_t v = 0; v < n; v++)
            other[v] = (float)((double)other[v] / gains[g] / gains[g]);
        assert_below(rig_difference(&r, one, other), 1e-3);
        free(other);
    }
    free(one);
}

static void silence_gives_a_silent_image(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    const struct scatterer nothing = {{0.0, 0.0, 1.1}, 0.0};
    float *image = rig_image(&r, "sparse", &nothing, 1, 1);
    for (size_t v = 0; v < grid_size(&r.grid); v++)
        assert_true(image[v] == 0.0f);
    free(image);
}

static void threads_do_not_change_it(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    const struct scatterer points[2] = {{{-0.03, 0.01, 1.1}, 1.0},
                                        {{0.03, 0.0, 1.12}, 0.7}};
    float *one = rig_image(&r, "sparse", points, 2, 1);
    float *three = rig_image(&r, "sparse", points, 2, 3);
    assert_memory_equal(one, three, grid_size(&r.grid) * sizeof *one);
    free(one);
    free(three);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forward_and_adjoint_pass_the_dot_product_test),
        cmocka_unit_test(the_normal_operator_is_adjoint_after_forward),
        cmocka_unit_test(the_gram_matrix_holds_the_normal_operator),
        cmocka_unit_test(a_point_sends_the_echoes_that_it_should),
        cmocka_unit_test(the_image_of_a_point_is_a_point),
        cmocka_unit_test(points_closer_than_the_diffraction_limit_come_apart),
        cmocka_unit_test(a_turntable_tells_close_points_apart),
        cmocka_unit_test(the_gain_of_the_recording_only_scales_it),
        cmocka_unit_test(silence_gives_a_silent_image),
        cmocka_unit_test(threads_do_not_change_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
