/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/power/lightcone.h"
#include "tests/recon/reference.h"

static struct pool *one_thread, *threads;

static struct lightcone_config small(void)
{
    return (struct lightcone_config){
        .nx = 6,
        .ny = 5,
        .pitch_x_m = 0.06,
        .pitch_y_m = 0.07,
        .nt = 40,
        .range_m = 0.5,
        .range_step_m = 0.01,
        .nz = 31,
        .depth_m = 0.52,
        .depth_step_m = 0.011,
        .falloff = 2.0,
        .snr = 100.0,
        .pool = one_thread,
    };
}

static size_t rho_size(const struct lightcone_config *c)
{
    return c->nx * c->ny * (c->nz ? c->nz : c->nt);
}

static size_t tau_size(const struct lightcone_config *c)
{
    return c->nx * c->ny * c->nt;
}

static float *floats(size_t n)
{
    float *x = calloc(n, sizeof *x);
    assert_non_null(x);
    return x;
}

static float *noise(size_t n, unsigned long long seed)
{
    float *x = floats(n);
    for (size_t i = 0; i < n; i++)
        x[i] = (float)(reference_random(&seed) - 0.5);
    return x;
}

static struct lightcone *create(const struct lightcone_config *c)
{
    struct lightcone *l = NULL;
    assert_int_equal(lightcone_create(&l, c), 0);
    return l;
}

static double dot(const float *a, const float *b, size_t n)
{
    double sum = 0.0;
    for (size_t i = 0; i < n; i++)
        sum += (double)a[i] * (double)b[i];
    return sum;
}

static double norm(const float *a, size_t n)
{
    return sqrt(dot(a, a, n));
}

/* -- against Eq. 9, integrated numerically ----------------------------------------------
 */

/* Bin n of the measurement at (jx, jy) from voxel (ix, iy, iz) of density 1: the volume
 * of the voxel in the bin's shell, by sampling it, over the bin's length, with falloff.
 */
static void add_voxel(const struct lightcone_config *c, size_t ix, size_t iy, size_t iz,
                      size_t jx, size_t jy, double *tau)
{
    enum { FACE = 24, DEPTH = 24 };
    double voxel_m3 = c->pitch_x_m * c->pitch_y_m * c->depth_step_m;
    for (int a = 0; a < FACE * FACE * DEPTH; a++) {
        double fx = ((double)(a % FACE) + 0.5) / FACE - 0.5;
        double fy = ((double)(a / FACE % FACE) + 0.5) / FACE - 0.5;
        double fz = ((double)(a / (FACE * FACE)) + 0.5) / DEPTH - 0.5;
        double x = ((double)ix - (double)jx + fx) * c->pitch_x_m;
        double y = ((double)iy - (double)jy + fy) * c->pitch_y_m;
        double z = c->depth_m + ((double)iz + fz) * c->depth_step_m;
        double r = sqrt(x * x + y * y + z * z);
        double n = rint((r - c->range_m) / c->range_step_m);
        if (n < 0.0 || n >= (double)c->nt)
            continue;
        double middle_m = c->range_m + n * c->range_step_m;
        tau[(size_t)n] += voxel_m3 / (FACE * FACE * DEPTH) / c->range_step_m *
                          pow(2.0 * middle_m, -c->falloff);
    }
}

/* One voxel's measurement against the integral.  Cells of squared range are a little
 * coarser or finer than bins, so both are compared as sums over time. */
static void a_voxel_is_measured_as_the_integral_says(void **state)
{
    (void)state;
    struct lightcone_config c = small();
    c.n_squared = 400; /* much finer than bins */
    struct lightcone *l = create(&c);
    float *rho = floats(rho_size(&c)), *tau = floats(tau_size(&c));
    const size_t ix = 1, iy = 3, iz = 8;
    rho[(iz * c.ny + iy) * c.nx + ix] = 1.0f;
    lightcone_forward(l, rho, tau);
    for (size_t jy = 0; jy < c.ny; jy++) {
        for (size_t jx = 0; jx < c.nx; jx++) {
            double exact[40] = {0}, total = 0.0, sum = 0.0, exact_sum = 0.0;
            add_voxel(&c, ix, iy, iz, jx, jy, exact);
            for (size_t n = 0; n < c.nt; n++)
                total += exact[n];
            for (size_t n = 0; n < c.nt; n++) {
                sum += tau[(jy * c.nx + jx) * c.nt + n];
                exact_sum += exact[n];
                assert_near(sum / total, exact_sum / total, 0.03);
            }
            assert_near(sum / total, 1.0, 0.005);
        }
    }
    lightcone_destroy(l);
    free(rho);
    free(tau);
}

/* -- properties -------------------------------------------------------------------------
 */

static void expect_adjoint(const struct lightcone_config *c)
{
    struct lightcone *l = create(c);
    float *x = noise(rho_size(c), 1), *y = noise(tau_size(c), 2);
    float *ax = floats(tau_size(c)), *aty = floats(rho_size(c));
    lightcone_forward(l, x, ax);
    lightcone_adjoint(l, y, aty);
    double scale = fmax(norm(ax, tau_size(c)) * norm(y, tau_size(c)), 1e-300);
    assert_near(dot(ax, y, tau_size(c)) / scale, dot(x, aty, rho_size(c)) / scale, 2e-6);
    assert_true(norm(ax, tau_size(c)) > 0.0);
    lightcone_destroy(l);
    free(x);
    free(y);
    free(ax);
    free(aty);
}

static void the_adjoint_is_the_transpose_of_forward(void **state)
{
    (void)state;
    struct lightcone_config c = small();
    expect_adjoint(&c);
    c.pool = threads;
    c.nx = 33; /* a length of 3 * 4^k does not fit, nor a multiple of 16 columns */
    c.ny = 17;
    c.falloff = 4.0;
    expect_adjoint(&c);
    c.nx = 23; /* 48 points */
    c.ny = 8;
    c.nz = 0;
    c.range_m = 0.0; /* from the very wall */
    c.falloff = 0.0;
    expect_adjoint(&c);
}

static void one_of_anything_is_enough(void **state)
{
    (void)state;
    for (int axis = 0; axis < 4; axis++) {
        struct lightcone_config c = small();
        c.nx = axis == 0 ? 1 : c.nx;
        c.ny = axis == 1 ? 1 : c.ny;
        c.nt = axis == 2 ? 1 : c.nt;
        c.nz = axis == 3 ? 1 : c.nz;
        c.depth_m = 0.5;
        expect_adjoint(&c);
    }
    struct lightcone_config c = small();
    c.nx = c.ny = c.nt = c.nz = 1;
    c.range_m = c.depth_m;
    expect_adjoint(&c);
}

typedef void (*operation)(struct lightcone *, const float *, float *);

static void expect_linear(operation op, size_t n_in, size_t n_out)
{
    struct lightcone_config c = small();
    struct lightcone *l = create(&c);
    float *a = noise(n_in, 3), *b = noise(n_in, 4), *sum = floats(n_in);
    float *ya = floats(n_out), *yb = floats(n_out), *y = floats(n_out);
    for (size_t i = 0; i < n_in; i++)
        sum[i] = 2.0f * a[i] - 0.5f * b[i];
    op(l, a, ya);
    op(l, b, yb);
    op(l, sum, y);
    for (size_t i = 0; i < n_out; i++)
        yb[i] = 2.0f * ya[i] - 0.5f * yb[i] - y[i];
    assert_below(norm(yb, n_out) / norm(y, n_out), 2e-6);
    lightcone_destroy(l);
    free(a);
    free(b);
    free(sum);
    free(ya);
    free(yb);
    free(y);
}

static void all_three_are_linear(void **state)
{
    (void)state;
    struct lightcone_config c = small();
    expect_linear(lightcone_forward, rho_size(&c), tau_size(&c));
    expect_linear(lightcone_adjoint, tau_size(&c), rho_size(&c));
    expect_linear(lightcone_inverse, tau_size(&c), rho_size(&c));
}

/* A voxel one place further in x or y is measured one place further, without wrapping. */
static void a_lateral_shift_is_a_lateral_shift(void **state)
{
    (void)state;
    struct lightcone_config c = small();
    struct lightcone *l = create(&c);
    float *rho = floats(rho_size(&c)), *a = floats(tau_size(&c));
    float *b = floats(tau_size(&c));
    double largest = 0.0;
    rho[(9 * c.ny + 1) * c.nx + 2] = 1.0f;
    lightcone_forward(l, rho, a);
    memset(rho, 0, rho_size(&c) * sizeof *rho);
    rho[(9 * c.ny + 2) * c.nx + 3] = 1.0f;
    lightcone_forward(l, rho, b);
    for (size_t i = 0; i < tau_size(&c); i++)
        largest = fmax(largest, a[i]);
    for (size_t y = 1; y < c.ny; y++)
        for (size_t x = 1; x < c.nx; x++)
            for (size_t n = 0; n < c.nt; n++)
                assert_near(b[(y * c.nx + x) * c.nt + n] / largest,
                            a[((y - 1) * c.nx + x - 1) * c.nt + n] / largest, 1e-5);
    lightcone_destroy(l);
    free(rho);
    free(a);
    free(b);
}

static void the_number_of_threads_does_not_matter(void **state)
{
    (void)state;
    struct lightcone_config c = small();
    float *tau = noise(tau_size(&c), 5);
    float *a = floats(rho_size(&c)), *b = floats(rho_size(&c));
    struct lightcone *l = create(&c);
    lightcone_inverse(l, tau, a);
    lightcone_destroy(l);
    c.pool = threads;
    l = create(&c);
    lightcone_inverse(l, tau, b);
    lightcone_destroy(l);
    for (size_t i = 0; i < rho_size(&c); i++)
        b[i] -= a[i];
    assert_below(norm(b, rho_size(&c)) / norm(a, rho_size(&c)), 1e-6);
    free(tau);
    free(a);
    free(b);
}

/* -- the inverse ------------------------------------------------------------------------
 */

/* Measurements of a point by Eq. 9, made here: 1 / (2 r)^n in the two bins around r. */
static void measure_point(const struct lightcone_config *c, const double at_m[3],
                          float *tau)
{
    for (size_t q = 0; q < c->nx * c->ny; q++) {
        double x = at_m[0] - (double)(q % c->nx) * c->pitch_x_m;
        double y = at_m[1] - (double)(q / c->nx) * c->pitch_y_m;
        double r = sqrt(x * x + y * y + at_m[2] * at_m[2]);
        double n = (r - c->range_m) / c->range_step_m, below = floor(n);
        double gain = pow(2.0 * r, -c->falloff);
        if (below >= 0.0 && below < (double)c->nt)
            tau[q * c->nt + (size_t)below] += (float)(gain * (1.0 - n + below));
        if (below >= -1.0 && below + 1.0 < (double)c->nt)
            tau[q * c->nt + (size_t)(below + 1.0)] += (float)(gain * (n - below));
    }
}

static struct lightcone_config wide(void)
{
    struct lightcone_config c = small();
    c.nx = 24;
    c.ny = 20;
    c.pitch_x_m = 0.02;
    c.pitch_y_m = 0.025;
    c.nt = 96;
    c.nz = 0;
    c.range_m = 0.4;
    c.range_step_m = 0.006;
    return c;
}

/* Centre of gravity of what is above half of the maximum. */
static void centre(const struct lightcone_config *c, const float *rho, double out[3])
{
    double largest = 0.0, weight = 0.0;
    memset(out, 0, 3 * sizeof *out);
    for (size_t i = 0; i < rho_size(c); i++) {
        assert_true(isfinite(rho[i]));
        largest = fmax(largest, rho[i]);
    }
    for (size_t i = 0; i < rho_size(c); i++) {
        if (rho[i] < 0.5 * largest)
            continue;
        double w = rho[i] - 0.5 * largest + 1e-9 * largest;
        weight += w;
        out[0] += w * (double)(i % c->nx) * c->pitch_x_m;
        out[1] += w * (double)(i / c->nx % c->ny) * c->pitch_y_m;
        out[2] += w * (c->range_m + (double)(i / (c->nx * c->ny)) * c->range_step_m);
    }
    for (int a = 0; a < 3; a++)
        out[a] /= weight;
}

static void a_point_is_where_it_is_in_the_middle_and_at_the_rim(void **state)
{
    (void)state;
    static const double at_m[4][3] = {
        {0.24, 0.225, 0.7}, {0.2, 0.3, 0.55}, {0.4, 0.1, 0.8}, {0.04, 0.45, 0.61}};
    struct lightcone_config c = wide();
    struct lightcone *l = create(&c);
    for (int p = 0; p < 4; p++) {
        float *tau = floats(tau_size(&c)), *rho = floats(rho_size(&c));
        double found[3];
        measure_point(&c, at_m[p], tau);
        lightcone_inverse(l, tau, rho);
        centre(&c, rho, found);
        assert_near(found[0], at_m[p][0], 0.5 * c.pitch_x_m);
        assert_near(found[1], at_m[p][1], 0.5 * c.pitch_y_m);
        assert_near(found[2], at_m[p][2], c.range_step_m);
        free(tau);
        free(rho);
    }
    lightcone_destroy(l);
}

/* The angle between a plate and the inverse of what is measured of it. */
static double angle_of_inverse(double taper)
{
    struct lightcone_config c = wide();
    c.snr = 10.0;
    c.taper = taper;
    struct lightcone *l = create(&c);
    float *rho = floats(rho_size(&c)), *tau = floats(tau_size(&c));
    float *back = floats(rho_size(&c));
    for (size_t y = 7; y < 14; y++)
        for (size_t x = 8; x < 15; x++)
            rho[(45 * c.ny + y) * c.nx + x] = 1.0f;
    lightcone_forward(l, rho, tau);
    lightcone_inverse(l, tau, back);
    double cosine = dot(rho, back, rho_size(&c)) /
                    (norm(rho, rho_size(&c)) * norm(back, rho_size(&c)));
    lightcone_destroy(l);
    free(rho);
    free(tau);
    free(back);
    return acos(cosine);
}

static void the_inverse_of_forward_is_near_a_plate_and_nearer_with_a_taper(void **state)
{
    (void)state;
    double sharp = angle_of_inverse(0.0), tapered = angle_of_inverse(0.1);
    assert_below(sharp, 0.85);
    assert_below(tapered, sharp - 0.05);
}

static void the_gain_of_a_recording_does_not_matter(void **state)
{
    (void)state;
    static const float gains[4] = {1e-12f, 0.03f, 30.0f, 1e12f};
    struct lightcone_config c = small();
    struct lightcone *l = create(&c);
    float *tau = noise(tau_size(&c), 6), *scaled = floats(tau_size(&c));
    float *a = floats(rho_size(&c)), *b = floats(rho_size(&c));
    lightcone_inverse(l, tau, a);
    for (int q = 0; q < 4; q++) {
        for (size_t i = 0; i < tau_size(&c); i++)
            scaled[i] = gains[q] * tau[i];
        lightcone_inverse(l, scaled, b);
        for (size_t i = 0; i < rho_size(&c); i++)
            b[i] = b[i] / gains[q] - a[i];
        assert_below(norm(b, rho_size(&c)) / norm(a, rho_size(&c)), 1e-5);
    }
    lightcone_destroy(l);
    free(tau);
    free(scaled);
    free(a);
    free(b);
}

static void any_trust_gives_finite_images(void **state)
{
    (void)state;
    for (int db = -20; db <= 60; db += 20) {
        struct lightcone_config c = small();
        c.snr = pow(10.0, 0.1 * db);
        struct lightcone *l = create(&c);
        float *tau = noise(tau_size(&c), 7), *rho = floats(rho_size(&c));
        for (size_t i = 0; i < tau_size(&c); i++)
            tau[i] *= 1e30f;
        lightcone_inverse(l, tau, rho);
        for (size_t i = 0; i < rho_size(&c); i++)
            assert_true(isfinite(rho[i]));
        assert_true(norm(rho, rho_size(&c)) > 0.0);
        lightcone_destroy(l);
        free(tau);
        free(rho);
    }
}

static void a_broken_measurement_does_not_spoil_the_next(void **state)
{
    (void)state;
    struct lightcone_config c = small();
    struct lightcone *l = create(&c);
    float *tau = noise(tau_size(&c), 8), *rho = floats(rho_size(&c));
    float kept = tau[17];
    tau[17] = NAN;
    lightcone_inverse(l, tau, rho);
    tau[17] = kept;
    lightcone_inverse(l, tau, rho);
    for (size_t i = 0; i < rho_size(&c); i++)
        assert_true(isfinite(rho[i]));
    memset(tau, 0, tau_size(&c) * sizeof *tau);
    lightcone_inverse(l, tau, rho);
    for (size_t i = 0; i < rho_size(&c); i++)
        assert_near(rho[i], 0.0, 0.0);
    lightcone_destroy(l);
    free(tau);
    free(rho);
}

static void values_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    struct lightcone_config bad[13];
    for (int q = 0; q < 13; q++)
        bad[q] = small();
    bad[0].nx = 0;
    bad[1].ny = 0;
    bad[2].nt = 0;
    bad[3].pitch_x_m = 0.0;
    bad[4].pitch_y_m = NAN;
    bad[5].range_m = -0.1;
    bad[6].range_step_m = 0.0;
    bad[7].snr = 0.0;
    bad[8].falloff = -1.0;
    bad[9].depth_step_m = INFINITY;
    bad[10].pool = NULL;
    bad[11].snr = NAN;
    bad[12].taper = 0.6;
    for (int q = 0; q < 13; q++) {
        struct lightcone *l = NULL;
        assert_int_equal(lightcone_create(&l, &bad[q]), -EINVAL);
        assert_null(l);
    }
    lightcone_destroy(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_voxel_is_measured_as_the_integral_says),
        cmocka_unit_test(the_adjoint_is_the_transpose_of_forward),
        cmocka_unit_test(one_of_anything_is_enough),
        cmocka_unit_test(all_three_are_linear),
        cmocka_unit_test(a_lateral_shift_is_a_lateral_shift),
        cmocka_unit_test(the_number_of_threads_does_not_matter),
        cmocka_unit_test(a_point_is_where_it_is_in_the_middle_and_at_the_rim),
        cmocka_unit_test(the_inverse_of_forward_is_near_a_plate_and_nearer_with_a_taper),
        cmocka_unit_test(the_gain_of_a_recording_does_not_matter),
        cmocka_unit_test(any_trust_gives_finite_images),
        cmocka_unit_test(a_broken_measurement_does_not_spoil_the_next),
        cmocka_unit_test(values_that_make_no_sense_are_refused),
    };
    if (pool_create(&one_thread, 1) || pool_create(&threads, 3))
        return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    pool_destroy(threads);
    pool_destroy(one_thread);
    return failed;
}
