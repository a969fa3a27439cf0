/* SPDX-License-Identifier: MIT */
/* Gaussians that are known, fitted; and the point spread function of an array in closed
 * form. */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "recon/inverse/psf.h"
#include "recon/processing.h"
#include "tests/recon/planned.h"

static const double sigma_m[3] = {0.031, 0.022, 0.013};
static const int row_of[6] = {0, 0, 0, 1, 1, 2}, column_of[6] = {0, 1, 2, 1, 2, 2};

struct gaussian {
    struct grid grid;
    double centre_m[3], axes[3][3], covariance_m2[6], precision[6];
    float *intensity; /* [grid] */
};

/* axes: what x, y and z become, turned by an angle about x, then by it about z. */
static void turn(double angle, double axes[3][3])
{
    double c = cos(angle), s = sin(angle);
    const double turned[3][3] = {{c, s, 0.0}, {-s * c, c * c, s}, {s * s, -c * s, c}};
    memcpy(axes, turned, sizeof turned);
}

/* Sum over the axes of sigma^power times their outer product. */
static void spread(const struct gaussian *g, double power, double out[6])
{
    for (int q = 0; q < 6; q++) {
        out[q] = 0.0;
        for (int a = 0; a < 3; a++)
            out[q] += pow(sigma_m[a], power) * g->axes[a][row_of[q]] *
                      g->axes[a][column_of[q]];
    }
}

/* Amplitude exp(-1/2 d' C^-1 d) times the gain, its centre between voxels. */
static void gaussian_create(struct gaussian *g, double angle, double gain, bool flat)
{
    *g =
        (struct gaussian){.grid = {{-0.2, 0.1, 0.9}, {0.006, 0.007, 0.004}, {61, 53, 71}},
                          .centre_m = {-0.0177, 0.2853, 1.0411}};
    if (flat) {
        g->grid.n[1] = 1;
        g->grid.origin_m[1] = g->centre_m[1];
    }
    turn(angle, g->axes);
    spread(g, 2.0, g->covariance_m2);
    spread(g, -2.0, g->precision);
    g->intensity = malloc(grid_size(&g->grid) * sizeof *g->intensity);
    assert_non_null(g->intensity);
    for (size_t v = 0; v < grid_size(&g->grid); v++) {
        const size_t *n = g->grid.n, at[3] = {v % n[0], v / n[0] % n[1], v / n[0] / n[1]};
        double d[3], form = 0.0;
        for (int a = 0; a < 3; a++)
            d[a] = g->grid.origin_m[a] + g->grid.step_m[a] * (double)at[a] -
                   g->centre_m[a];
        for (int q = 0; q < 6; q++)
            form += (row_of[q] == column_of[q] ? 1.0 : 2.0) * g->precision[q] *
                    d[row_of[q]] * d[column_of[q]];
        g->intensity[v] = (float)(gain * gain * exp(-form));
    }
}

static void gaussian_fit(const struct gaussian *g, struct psf *out)
{
    size_t best = 0;
    for (size_t v = 0; v < grid_size(&g->grid); v++)
        best = g->intensity[v] > g->intensity[best] ? v : best;
    assert_int_equal(psf_fit(out, &g->grid, g->intensity, best), 0);
    for (int a = 0; a < 3; a++)
        assert_near(out->centre_m[a], g->centre_m[a], 1e-5);
    assert_below(out->residual, 1e-4);
}

static void expect_covariance(const double is[6], const double expected[6], double part)
{
    static const int diagonal[3] = {0, 3, 5};
    for (int q = 0; q < 6; q++)
        assert_near(is[q], expected[q],
                    part * sqrt(expected[diagonal[row_of[q]]] *
                                expected[diagonal[column_of[q]]]));
}

static double degrees_between(const double a[3], const double b[3])
{
    double dot = fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
    return acos(fmin(dot, 1.0)) * 180.0 / M_PI;
}

static void expect_axes(const struct psf *p, const struct gaussian *g)
{
    double width_m[3], axes[3][3];
    psf_axes(p, width_m, axes);
    for (int a = 0; a < 3; a++) {
        assert_near(width_m[a] / (2.0 * sqrt(2.0 * log(2.0)) * sigma_m[a]), 1.0, 5e-3);
        assert_below(degrees_between(axes[a], g->axes[a]), 0.5);
    }
}

/* -- the fit ----------------------------------------------------------------------------
 */

static void a_gaussian_turned_about_two_axes_is_found_as_it_is(void **state)
{
    (void)state;
    static const double angles[4] = {0.0, M_PI / 6.0, -M_PI / 6.0, M_PI / 4.0};
    for (int q = 0; q < 4; q++) {
        struct gaussian g;
        struct psf p;
        double width_m[3];
        gaussian_create(&g, angles[q], 1.0, false);
        gaussian_fit(&g, &p);
        expect_covariance(p.covariance_m2, g.covariance_m2, 0.01);
        expect_axes(&p, &g);
        assert_near(p.peak, 1.0, 1e-3);
        psf_widths(&p, width_m);
        static const int diagonal[3] = {0, 3, 5};
        for (int a = 0; a < 3; a++) /* exp(-d^2 / C^-1_aa) is a quarter */
            assert_near(width_m[a], 2.0 * sqrt(2.0 * log(2.0) / g.precision[diagonal[a]]),
                        1e-4);
        free(g.intensity);
    }
}

static void gains_of_twelve_decades_change_the_peak_alone(void **state)
{
    (void)state;
    static const double gains[2] = {1e-12, 1e12};
    for (int q = 0; q < 2; q++) {
        struct gaussian g;
        struct psf p;
        gaussian_create(&g, M_PI / 6.0, gains[q], false);
        gaussian_fit(&g, &p);
        expect_covariance(p.covariance_m2, g.covariance_m2, 0.01);
        expect_axes(&p, &g);
        assert_near(p.peak / (gains[q] * gains[q]), 1.0, 1e-3);
        free(g.intensity);
    }
}

/* What is left of the Gaussian is its section: the inverse of C^-1 without that axis. */
static void an_axis_of_one_voxel_has_no_width(void **state)
{
    (void)state;
    struct gaussian g;
    struct psf p;
    double width_m[3];
    gaussian_create(&g, M_PI / 6.0, 1.0, true);
    gaussian_fit(&g, &p);
    const double *k = g.precision;
    double determinant = k[0] * k[5] - k[2] * k[2];
    const double section[3] = {k[5] / determinant, -k[2] / determinant,
                               k[0] / determinant};
    assert_near(p.covariance_m2[0] / section[0], 1.0, 0.01);
    assert_near(p.covariance_m2[2] / section[1], 1.0, 0.01);
    assert_near(p.covariance_m2[5] / section[2], 1.0, 0.01);
    for (int q = 0; q < 6; q++)
        if (row_of[q] == 1 || column_of[q] == 1)
            assert_true(p.covariance_m2[q] == 0.0);
    psf_widths(&p, width_m);
    assert_true(width_m[1] == 0.0);
    assert_true(width_m[0] > 0.0 && width_m[2] > 0.0);
    free(g.intensity);
}

static void the_rest_of_the_image_does_not_matter(void **state)
{
    (void)state;
    struct gaussian g;
    struct psf p;
    gaussian_create(&g, M_PI / 6.0, 1.0, false);
    g.intensity[0] = NAN;
    g.intensity[1] = INFINITY;
    g.intensity[2] = 50.0f;
    size_t n[3] = {31, 26, 35}; /* of a voxel near the centre */
    assert_int_equal(psf_fit(&p, &g.grid, g.intensity,
                             (n[2] * g.grid.n[1] + n[1]) * g.grid.n[0] + n[0]),
                     0);
    expect_covariance(p.covariance_m2, g.covariance_m2, 0.01);
    free(g.intensity);
}

static void what_is_no_point_is_refused(void **state)
{
    (void)state;
    static float v[9 * 9 * 9];
    const struct grid grid = {{0.0, 0.0, 1.0}, {0.01, 0.01, 0.01}, {9, 9, 9}};
    struct psf p;
    assert_int_equal(psf_fit(&p, &grid, v, 364), -EINVAL); /* silence */
    assert_int_equal(psf_fit(&p, &grid, v, 729), -EINVAL); /* no voxel */
    v[364] = NAN;
    assert_int_equal(psf_fit(&p, &grid, v, 364), -EINVAL);
    v[364] = -1.0f;
    assert_int_equal(psf_fit(&p, &grid, v, 364), -EINVAL);
    v[364] = 1.0f; /* a single voxel: narrower than can be told */
    assert_int_equal(psf_fit(&p, &grid, v, 364), -ERANGE);
}

/* Evenly bright; a bar along z; a top in x and y that falls towards -z, whose summit lies
 * beyond. */
static void what_does_not_fall_all_round_is_refused(void **state)
{
    (void)state;
    static float even[9 * 9 * 9], bar[9 * 9 * 9], ramp[9 * 9 * 9];
    const struct grid grid = {{0.0, 0.0, 1.0}, {0.01, 0.01, 0.01}, {9, 9, 9}};
    struct psf p;
    for (size_t i = 0; i < 9 * 9 * 9; i++) {
        double x = (double)(i % 9) - 4.0, y = (double)(i / 9 % 9) - 4.0;
        double z = (double)(i / 81) - 4.0, across = exp(-0.05 * (x * x + y * y));
        even[i] = 1.0f;
        bar[i] = (float)across;
        ramp[i] = (float)(across * exp(0.3 * z));
    }
    assert_int_equal(psf_fit(&p, &grid, even, 364), -ERANGE);
    assert_int_equal(psf_fit(&p, &grid, bar, 364), -ERANGE);
    assert_int_equal(psf_fit(&p, &grid, ramp, 364), -ERANGE);
}

/* Discs and lines, however they are turned: the determinant is 0 but for rounding. */
static void what_is_flat_has_no_inverse(void **state)
{
    (void)state;
    const double disc[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 0.0};
    double turned[6], line[6], inverse[6], axes[3][3];
    for (int q = 0; q < 8; q++) {
        turn(0.1 + 0.3 * q, axes);
        for (int k = 0; k < 6; k++) {
            line[k] = axes[0][row_of[k]] * axes[0][column_of[k]];
            turned[k] = line[k] + axes[1][row_of[k]] * axes[1][column_of[k]];
        }
        assert_false(psf_invert(line, inverse));
        assert_false(psf_invert(turned, inverse));
    }
    assert_false(psf_invert(disc, inverse));
}

/* -- arrays -----------------------------------------------------------------------------
 */

enum { NX = 8, NY = 6, FAR_M = 6 };

/* Speakers with their microphones on a lattice, 0.35 x 0.25 m around 0, and a point far
 * before it. */
static void array_create(struct geometry *g, double pings_m[NX * NY][2][3])
{
    for (size_t k = 0; k < NX * NY; k++)
        for (int e = 0; e < 2; e++) {
            pings_m[k][e][0] = 0.05 * ((double)(k % NX) - 0.5 * (NX - 1));
            pings_m[k][e][1] = 0.05 * ((double)(k / NX) - 0.5 * (NY - 1));
            pings_m[k][e][2] = 0.0;
        }
    *g = (struct geometry){.sound_speed_m_s = 343.0,
                           .n_speakers = 1,
                           .n_microphones = 1,
                           .n_positions = NX * NY,
                           .pings_m = (const double(*)[2][3])pings_m};
}

/* k = 4 pi f x / c r across and 4 pi f / c along: n places a pitch apart vary by pitch^2
 * (n^2 - 1) / 12, and a Hann-windowed band by 1/12 - 1/(2 pi^2) of its width's square. */
static void an_array_s_curvature_is_the_spread_of_its_wave_vectors(void **state)
{
    (void)state;
    double pings_m[NX * NY][2][3], covariance_m2[6];
    struct geometry g;
    array_create(&g, pings_m);
    const struct psf_config cfg = {
        .geometry = &g, .band_hz = {2000.0, 20000.0}, .at_m = {0.0, 0.0, FAR_M}};
    double turns = 4.0 * M_PI / 343.0, hann = 1.0 / 12.0 - 0.5 / (M_PI * M_PI);
    double f2 = 11000.0 * 11000.0 + hann * 18000.0 * 18000.0;
    double across = turns * turns * f2 * 0.05 * 0.05 / (12.0 * FAR_M * FAR_M);
    const double expected[6] = {1.0 / (across * (NX * NX - 1)),
                                0.0,
                                0.0,
                                1.0 / (across * (NY * NY - 1)),
                                0.0,
                                1.0 / (turns * turns * hann * 18000.0 * 18000.0)};
    assert_int_equal(psf_curvature(&cfg, covariance_m2), 0);
    expect_covariance(covariance_m2, expected, 0.01);
}

static void the_fit_to_an_array_s_image_is_near_its_curvature(void **state)
{
    (void)state;
    double pings_m[NX * NY][2][3], covariance_m2[6];
    struct geometry g;
    struct grid grid;
    struct psf p;
    float *intensity;
    array_create(&g, pings_m);
    const struct psf_config cfg = {
        .geometry = &g, .band_hz = {2000.0, 20000.0}, .at_m = {0.4, -0.3, FAR_M}};
    assert_int_equal(psf_curvature(&cfg, covariance_m2), 0);
    assert_int_equal(psf_compute(&p, &cfg, &grid, &intensity), 0);
    expect_covariance(p.covariance_m2, covariance_m2, 0.15);
    assert_near(intensity[grid_size(&grid) / 2], 1.0, 1e-6);
    for (int a = 0; a < 3; a++)
        assert_near(p.centre_m[a], cfg.at_m[a], a < 2 ? 5e-3 : 1e-3);
    free(intensity);
}

/* Its midpoints all differ; what would share one on a stage that stands counts as one. */
static void a_stage_that_goes_on_has_the_widths_of_one_that_stands(void **state)
{
    (void)state;
    struct survey s = planned_survey();
    struct geometry g;
    struct psf_config cfg = {
        .geometry = &g, .band_hz = {2000, 20000}, .at_m = {0.2, 0.25, 1.4}};
    struct psf fit;
    double stands_m[3], goes_on_m[3];
    processing_geometry(&g, &s);
    assert_int_equal(psf_compute(&fit, &cfg, NULL, NULL), 0);
    psf_widths(&fit, stands_m);
    s.continuous = true;
    processing_geometry(&g, &s);
    assert_int_equal(psf_compute(&fit, &cfg, NULL, NULL), 0);
    psf_widths(&fit, goes_on_m);
    for (int a = 0; a < 3; a++)
        assert_near(goes_on_m[a] / stands_m[a], 1.0, 0.05);
}

static bool third_time(void *ctx)
{
    return ++*(int *)ctx == 3;
}

static void who_waits_for_a_fit_can_stop_it(void **state)
{
    (void)state;
    double pings_m[NX * NY][2][3];
    struct geometry g;
    struct grid grid;
    struct psf p;
    float *intensity = NULL;
    int asked = 0;
    array_create(&g, pings_m);
    const struct psf_config cfg = {.geometry = &g,
                                   .band_hz = {2000.0, 20000.0},
                                   .at_m = {0.4, -0.3, FAR_M},
                                   .stop = third_time,
                                   .stop_ctx = &asked};
    assert_int_equal(psf_compute(&p, &cfg, &grid, &intensity), -ECANCELED);
    assert_int_equal(asked, 3);
    assert_null(intensity);
}

static void an_array_that_resolves_no_axis_says_so(void **state)
{
    (void)state;
    double pings_m[NX * NY][2][3], covariance_m2[6];
    struct geometry g;
    struct psf p;
    array_create(&g, pings_m);
    g.n_positions = 1;
    const struct psf_config cfg = {
        .geometry = &g, .band_hz = {2000.0, 20000.0}, .at_m = {0.0, 0.0, FAR_M}};
    assert_int_equal(psf_curvature(&cfg, covariance_m2), -ERANGE);
    assert_int_equal(psf_compute(&p, &cfg, NULL, NULL), -ERANGE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_gaussian_turned_about_two_axes_is_found_as_it_is),
        cmocka_unit_test(gains_of_twelve_decades_change_the_peak_alone),
        cmocka_unit_test(an_axis_of_one_voxel_has_no_width),
        cmocka_unit_test(the_rest_of_the_image_does_not_matter),
        cmocka_unit_test(what_is_no_point_is_refused),
        cmocka_unit_test(what_does_not_fall_all_round_is_refused),
        cmocka_unit_test(what_is_flat_has_no_inverse),
        cmocka_unit_test(an_array_s_curvature_is_the_spread_of_its_wave_vectors),
        cmocka_unit_test(the_fit_to_an_array_s_image_is_near_its_curvature),
        cmocka_unit_test(a_stage_that_goes_on_has_the_widths_of_one_that_stands),
        cmocka_unit_test(who_waits_for_a_fit_can_stop_it),
        cmocka_unit_test(an_array_that_resolves_no_axis_says_so),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
