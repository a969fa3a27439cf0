/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <complex.h>

#include "recon/detection/peak.h"
#include "tests/recon/reference.h"

#define N      7
#define VOXELS (N * N * N)

static const struct grid grid = {{-0.4, 0.1, 1.2}, {0.02, 0.015, 0.005}, {N, N, N}};

/* level exp(-d' p d / 2), d in m from a place; p: xx xy xz yy yz zz in 1/m^2. */
static void paint(const struct grid *g, const double at_m[3], const double p[6],
                  double level, float *out)
{
    for (size_t v = 0; v < grid_size(g); v++) {
        const size_t i[3] = {v % g->n[0], v / g->n[0] % g->n[1], v / (g->n[0] * g->n[1])};
        double d[3];
        for (int a = 0; a < 3; a++)
            d[a] = g->origin_m[a] + g->step_m[a] * (double)i[a] - at_m[a];
        double sum = p[0] * d[0] * d[0] + p[3] * d[1] * d[1] + p[5] * d[2] * d[2] +
                     2.0 * (p[1] * d[0] * d[1] + p[2] * d[0] * d[2] + p[4] * d[1] * d[2]);
        out[v] = (float)(level * exp(-0.5 * sum));
    }
}

static const int diagonal[3] = {0, 3, 5};

static size_t voxel_at(const struct grid *g, size_t x, size_t y, size_t z)
{
    return (z * g->n[1] + y) * g->n[0] + x;
}

static const double sigma_m[3] = {0.03, 0.02, 0.008};
static const double upright[6] = {1.0 / 9e-4, 0.0, 0.0, 1.0 / 4e-4, 0.0, 1.0 / 64e-6};

static void a_gaussian_is_found_between_the_voxels(void **state)
{
    (void)state;
    for (int q = 0; q < 27; q++) {
        const double shift[3] = {0.4 * (q % 3 - 1), 0.4 * (q / 3 % 3 - 1),
                                 0.4 * (q / 9 - 1)};
        double at[3];
        float v[VOXELS];
        struct peak_fit fit;
        for (int a = 0; a < 3; a++)
            at[a] = grid.origin_m[a] + grid.step_m[a] * (3.0 + shift[a]);
        paint(&grid, at, upright, 5.0, v);
        peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), 100.0, PEAK_ZERO_EMPTY, NULL, &fit);
        for (int a = 0; a < 3; a++) {
            assert_near(fit.position_m[a], at[a], 1e-4 * grid.step_m[a]);
            /* A factor of 4: 2 sigma sqrt(2 ln 4). */
            assert_near(fit.width_m[a], 2.0 * sigma_m[a] * sqrt(2.0 * log(4.0)),
                        1e-3 * sigma_m[a]);
        }
    }
}

/* The inverse of a symmetric matrix. */
static void invert(const double c[6], double p[6])
{
    double det = c[0] * (c[3] * c[5] - c[4] * c[4]) - c[1] * (c[1] * c[5] - c[4] * c[2]) +
                 c[2] * (c[1] * c[4] - c[3] * c[2]);
    p[0] = (c[3] * c[5] - c[4] * c[4]) / det;
    p[1] = (c[2] * c[4] - c[1] * c[5]) / det;
    p[2] = (c[1] * c[4] - c[2] * c[3]) / det;
    p[3] = (c[0] * c[5] - c[2] * c[2]) / det;
    p[4] = (c[1] * c[2] - c[0] * c[4]) / det;
    p[5] = (c[0] * c[3] - c[1] * c[1]) / det;
}

static const double tilted[6] = {9e-4, 2e-4, -5e-5, 4e-4, 6e-5, 64e-6}; /* m^2 */

/* As the image of a point aside is, across its line of sight. */
static void a_tilted_gaussian_is_found_between_the_voxels(void **state)
{
    (void)state;
    double p[6];
    invert(tilted, p);
    for (int q = 0; q < 27; q++) {
        const double shift[3] = {0.3 * (q % 3 - 1), 0.3 * (q / 3 % 3 - 1),
                                 0.3 * (q / 9 - 1)};
        double at[3];
        float v[VOXELS];
        struct peak_fit fit;
        size_t best = 0;
        for (int a = 0; a < 3; a++)
            at[a] = grid.origin_m[a] + grid.step_m[a] * (3.0 + shift[a]);
        paint(&grid, at, p, 5.0, v);
        for (size_t e = 0; e < VOXELS; e++)
            best = v[e] > v[best] ? e : best;
        peak_fit(&grid, v, best, 100.0, PEAK_ZERO_EMPTY, NULL, &fit);
        for (int a = 0; a < 3; a++)
            assert_near(fit.position_m[a], at[a], 1e-3 * grid.step_m[a]);
    }
}

/* Inverse curvature of the log intensity over the SNR: for a peak exp(-d^2 / s^2) and
 * noise of the same shape, the Cramer-Rao bound s^2 / 2 / SNR. */
static void the_covariance_is_the_shape_over_the_snr(void **state)
{
    (void)state;
    static const double snrs[2] = {20.0, 2000.0};
    double p[6], at[3];
    invert(tilted, p);
    for (int q = 0; q < 2; q++) {
        float v[VOXELS];
        struct peak_fit fit;
        for (int a = 0; a < 3; a++)
            at[a] = grid.origin_m[a] + grid.step_m[a] * 3.0;
        paint(&grid, at, p, 1.0, v);
        peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), snrs[q], PEAK_ZERO_EMPTY, NULL,
                 &fit);
        for (int e = 0; e < 6; e++)
            assert_near(fit.covariance_m2[e], tilted[e] / snrs[q],
                        2e-3 * tilted[0] / snrs[q]);
    }
}

#define WHITE  13 /* white noise around the 3 x 3 x 3 voxels of a fit */
#define KERNEL (WHITE - 2)

/* noise[27] of power 1, correlated as the images of points are: with amplitudes
 * exp(-d^2 / 4 s^2), s = 1.5 voxels. */
static void make_noise(unsigned long long *seed, double complex *noise)
{
    static double complex white[WHITE * WHITE * WHITE];
    double kernel[KERNEL], power = 0.0;
    for (int k = 0; k < KERNEL; k++) {
        kernel[k] = exp(-pow((k - KERNEL / 2) / 1.5, 2.0) / 2.0);
        power += kernel[k] * kernel[k];
    }
    for (size_t w = 0; w < WHITE * WHITE * WHITE; w++)
        white[w] = sqrt(-log(reference_random(seed))) *
                   cexp(2.0 * M_PI * I * reference_random(seed));
    for (int v = 0; v < 27; v++) {
        noise[v] = 0.0;
        for (int q = 0; q < KERNEL * KERNEL * KERNEL; q++) {
            int x = q % KERNEL, y = q / KERNEL % KERNEL, z = q / (KERNEL * KERNEL);
            int at = ((z + v / 9) * WHITE + y + v / 3 % 3) * WHITE + x + v % 3;
            noise[v] += kernel[x] * kernel[y] * kernel[z] * white[at];
        }
        noise[v] /= pow(power, 1.5);
    }
}

/* Positions scatter as the covariance says: 150 peaks in noise, 3 axes; the variance of
 * that many is known to 7 %. */
static void noisy_peaks_scatter_as_their_covariance_says(void **state)
{
    (void)state;
    const struct grid three = {{0.0, 0.0, 1.0}, {0.02, 0.02, 0.02}, {3, 3, 3}};
    const double snr = 1000.0;
    unsigned long long seed = 77;
    double sum = 0.0;
    for (int trial = 0; trial < 150; trial++) {
        double complex noise[27];
        float v[27];
        struct peak_fit fit;
        make_noise(&seed, noise);
        for (int q = 0; q < 27; q++) {
            double d2 = pow(q % 3 - 1, 2.0) + pow(q / 3 % 3 - 1, 2.0) +
                        pow(q / 9 - 1, 2.0);
            double a = cabs(sqrt(snr) * exp(-d2 / (4.0 * 1.5 * 1.5)) + noise[q]);
            v[q] = (float)(a * a);
        }
        peak_fit(&three, v, 13, snr, PEAK_ZERO_EMPTY, NULL, &fit);
        for (int a = 0; a < 3; a++) {
            double error_m = fit.position_m[a] - three.origin_m[a] - 0.02;
            sum += error_m * error_m / fit.covariance_m2[diagonal[a]];
        }
    }
    assert_near(sum / 450.0, 1.0, 0.3);
}

static void the_scale_of_the_intensity_does_not_matter(void **state)
{
    (void)state;
    static const double levels[2] = {1e-24, 1e24};
    double at[3];
    float v[VOXELS];
    struct peak_fit fit[2];
    for (int a = 0; a < 3; a++)
        at[a] = grid.origin_m[a] + grid.step_m[a] * (3.0 + 0.2 * a);
    for (int q = 0; q < 2; q++) {
        paint(&grid, at, upright, levels[q], v);
        peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), 10.0, PEAK_ZERO_EMPTY, NULL,
                 &fit[q]);
    }
    for (int a = 0; a < 3; a++) {
        assert_near(fit[0].position_m[a], at[a], 1e-3 * grid.step_m[a]);
        assert_near(fit[1].position_m[a], at[a], 1e-3 * grid.step_m[a]);
        assert_near(fit[0].width_m[a], fit[1].width_m[a], 1e-3 * fit[0].width_m[a]);
    }
}

static void expect_sound(const struct peak_fit *fit)
{
    for (int a = 0; a < 3; a++) {
        assert_true(isfinite(fit->position_m[a]));
        assert_true(isfinite(fit->width_m[a]) && fit->width_m[a] > 0.0);
        assert_true(fit->covariance_m2[diagonal[a]] > 0.0);
    }
    for (int q = 0; q < 6; q++)
        assert_true(isfinite(fit->covariance_m2[q]));
}

/* Of the axis nothing is known, of the others what that signal to noise lets know: at a
 * border that of the image itself, however high it is. */
static void expect_unknown(const struct peak_fit *fit, int axis, double snr)
{
    for (int a = 0; a < 3; a++) {
        double variance_m2 = a == axis ? PEAK_UNKNOWN_M * PEAK_UNKNOWN_M
                                       : sigma_m[a] * sigma_m[a] / snr;
        assert_near(fit->covariance_m2[diagonal[a]], variance_m2, 2e-3 * variance_m2);
        if (a == axis)
            assert_near(fit->width_m[a], N * grid.step_m[a], 1e-9);
    }
}

static void on_the_rim_an_axis_stays_on_its_voxel(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++) {
        for (int far = 0; far <= 1; far++) {
            size_t i[3] = {3, 3, 3};
            double at[3];
            float v[VOXELS];
            struct peak_fit fit;
            i[axis] = far ? N - 1 : 0;
            for (int a = 0; a < 3; a++)
                at[a] = grid.origin_m[a] + grid.step_m[a] * ((double)i[a] + 0.25);
            paint(&grid, at, upright, 1.0, v);
            peak_fit(&grid, v, voxel_at(&grid, i[0], i[1], i[2]), 50.0, PEAK_ZERO_EMPTY,
                     NULL, &fit);
            expect_sound(&fit);
            for (int a = 0; a < 3; a++) {
                double expected = at[a] - (a == axis ? 0.25 * grid.step_m[a] : 0.0);
                assert_near(fit.position_m[a], expected, 1e-4 * grid.step_m[a]);
            }
            expect_unknown(&fit, axis, 1.0);
            assert_int_equal(fit.at_border, PEAK_BORDER(axis, far));
        }
    }
}

/* What lies behind the gate was not imaged: it is 0, and as good as outside of the grid.
 */
static void where_the_gate_ends_an_axis_is_not_known(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++) {
        double at[3];
        float v[VOXELS];
        struct peak_fit fit;
        for (int a = 0; a < 3; a++)
            at[a] = grid.origin_m[a] + grid.step_m[a] * 3.0;
        paint(&grid, at, upright, 1.0, v);
        for (size_t q = 0; q < VOXELS; q++) {
            const size_t i[3] = {q % N, q / N % N, q / (N * N)};
            v[q] = i[axis] > 3 ? 0.0f : v[q];
        }
        peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), 50.0, PEAK_ZERO_UNSEEN, NULL, &fit);
        for (int a = 0; a < 3; a++)
            assert_near(fit.position_m[a], at[a], 1e-4 * grid.step_m[a]);
        expect_unknown(&fit, axis, 1.0);
        assert_int_equal(fit.at_border, PEAK_BORDER(axis, 1));
    }
}

/* Of sparse images: something may be anywhere in its voxel, which is nearer to the
 * brighter of two. */
static void beside_emptiness_an_axis_is_known_to_a_voxel(void **state)
{
    (void)state;
    float v[VOXELS] = {0};
    struct peak_fit fit;
    v[voxel_at(&grid, 3, 3, 3)] = 1.0f;
    v[voxel_at(&grid, 4, 3, 3)] = 0.25f;
    peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), 1e6, PEAK_ZERO_EMPTY, NULL, &fit);
    expect_sound(&fit);
    assert_int_equal(fit.at_border, 0);
    for (int a = 0; a < 3; a++) {
        double shift = (fit.position_m[a] - grid.origin_m[a]) / grid.step_m[a] - 3.0;
        if (a == 0)
            assert_true(shift > 0.0 && shift < 0.5);
        else
            assert_near(shift, 0.0, 1e-9);
        assert_near(fit.covariance_m2[diagonal[a]],
                    grid.step_m[a] * grid.step_m[a] / 12.0,
                    1e-4 * grid.step_m[a] * grid.step_m[a]);
        assert_true(fit.width_m[a] < 2.0 * grid.step_m[a]);
    }
}

/* A line of elements along x hears only how far from it something is: the image is a
 * ridge around it that is turned here by 30 degrees.  Its place is known across, and
 * along the ridge not at all, or as far as it is bright. */
static void a_turned_ridge_is_known_across_it_alone(void **state)
{
    (void)state;
    const struct grid even = {{0.0, 0.0, 1.0}, {0.01, 0.01, 0.01}, {N, N, N}};
    static const double body_m[3] = {0.03, 0.4, 0.3};
    const double c = cos(M_PI / 6.0), s = sin(M_PI / 6.0), sigma_across_m = 0.008;
    const double p[6] = {1.0 / 9e-4,
                         0.0,
                         0.0,
                         s * s / (sigma_across_m * sigma_across_m),
                         s * c / (sigma_across_m * sigma_across_m),
                         c * c / (sigma_across_m * sigma_across_m)};
    const double at[3] = {0.03, 0.03, 1.03};
    float v[VOXELS];
    paint(&even, at, p, 1.0, v);
    for (int known = 0; known <= 1; known++) {
        struct peak_fit fit;
        peak_fit(&even, v, voxel_at(&even, 3, 3, 3), 100.0, PEAK_ZERO_UNSEEN,
                 known ? body_m : NULL, &fit);
        const double *m = fit.covariance_m2;
        double along_m2 = c * c * m[3] - 2.0 * s * c * m[4] + s * s * m[5];
        double across_m2 = s * s * m[3] + 2.0 * s * c * m[4] + c * c * m[5];
        double length_m = fmin(body_m[1] / c, body_m[2] / s);
        expect_sound(&fit);
        assert_int_equal(fit.at_border, 0);
        assert_near(along_m2,
                    known ? length_m * length_m / 12.0 : PEAK_UNKNOWN_M * PEAK_UNKNOWN_M,
                    1e-5 * along_m2);
        assert_near(across_m2, sigma_across_m * sigma_across_m / 100.0,
                    2e-3 * sigma_across_m * sigma_across_m / 100.0 + 1e-10 * along_m2);
        assert_near(m[0], 9e-4 / 100.0, 1e-7);
        for (int a = 0; a < 3; a++)
            assert_near(fit.position_m[a], at[a], 1e-5);
    }
}

static void a_ridge_stays_on_its_voxel_along_itself(void **state)
{
    (void)state;
    const double along_y[6] = {1.0 / 9e-4, 0.0, 0.0, 0.0, 0.0, 1.0 / 64e-6};
    double at[3];
    float v[VOXELS];
    struct peak_fit fit;
    for (int a = 0; a < 3; a++)
        at[a] = grid.origin_m[a] + grid.step_m[a] * 3.3;
    paint(&grid, at, along_y, 1.0, v);
    peak_fit(&grid, v, voxel_at(&grid, 3, 2, 3), 50.0, PEAK_ZERO_EMPTY, NULL, &fit);
    expect_sound(&fit);
    assert_near(fit.position_m[0], at[0], 1e-4 * grid.step_m[0]);
    assert_near(fit.position_m[1], grid.origin_m[1] + 2.0 * grid.step_m[1], 1e-9);
    assert_near(fit.position_m[2], at[2], 1e-4 * grid.step_m[2]);
    expect_unknown(&fit, 1, 50.0);
    assert_int_equal(fit.at_border, 0);
}

/* As long and tilted as what an array without extent in x sees of a point, its top far
 * outside: the place found is on its crest, whatever its distance from the top. */
static void a_long_tilted_ridge_is_not_left(void **state)
{
    (void)state;
    const double along_m[3] = {0.02, 0.0, -0.004}, across_m[3] = {0.004, 0.0, 0.02};
    double length2 = 0.02 * 0.02 + 0.004 * 0.004, p[6], at[3];
    float v[VOXELS];
    struct peak_fit fit;
    for (int a = 0, q = 0; a < 3; a++)
        for (int b = a; b < 3; b++, q++)
            p[q] = along_m[a] * along_m[b] / length2 / 0.04 +
                   across_m[a] * across_m[b] / length2 / 64e-6 +
                   (a == 1 && b == 1 ? 1.0 / 4e-4 : 0.0);
    for (int a = 0; a < 3; a++) /* 6 voxels along the ridge from voxel 3, 3, 3 */
        at[a] = grid.origin_m[a] + 3.0 * grid.step_m[a] + 6.0 * along_m[a];
    paint(&grid, at, p, 1.0, v);
    peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), 50.0, PEAK_ZERO_EMPTY, NULL, &fit);
    double aside_m = 0.0;
    for (int a = 0; a < 3; a++)
        aside_m += (fit.position_m[a] - at[a]) * across_m[a] / sqrt(length2);
    assert_near(aside_m, 0.0, 1e-4);
    assert_near(fit.position_m[0] - grid.origin_m[0], 4.0 * grid.step_m[0], 1e-3);
}

static void a_voxel_that_is_no_peak_stays_where_it_is(void **state)
{
    (void)state;
    const double hollow[6] = {-1.0 / 9e-4, 0.0, 0.0, -1.0 / 4e-4, 0.0, -1.0 / 64e-6};
    double at[3];
    float v[VOXELS];
    struct peak_fit fit;
    for (int a = 0; a < 3; a++)
        at[a] = grid.origin_m[a] + grid.step_m[a] * 3.2;
    paint(&grid, at, hollow, 1.0, v);
    peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), 50.0, PEAK_ZERO_EMPTY, NULL, &fit);
    expect_sound(&fit);
    for (int a = 0; a < 3; a++) {
        assert_near(fit.position_m[a], grid.origin_m[a] + 3.0 * grid.step_m[a], 1e-9);
        assert_near(fit.width_m[a], N * grid.step_m[a], 1e-9);
        assert_near(fit.covariance_m2[diagonal[a]], PEAK_UNKNOWN_M * PEAK_UNKNOWN_M,
                    1e-3);
    }
}

static void one_voxel_is_its_own_peak(void **state)
{
    (void)state;
    const struct grid one = {{0.1, 0.2, 0.3}, {0.01, 0.02, 0.03}, {1, 1, 1}};
    const float v[1] = {2.0f};
    struct peak_fit fit;
    peak_fit(&one, v, 0, 50.0, PEAK_ZERO_EMPTY, NULL, &fit);
    expect_sound(&fit);
    for (int a = 0; a < 3; a++) {
        assert_near(fit.position_m[a], one.origin_m[a], 1e-12);
        assert_near(fit.width_m[a], one.step_m[a], 1e-9);
        assert_near(fit.covariance_m2[diagonal[a]], PEAK_UNKNOWN_M * PEAK_UNKNOWN_M,
                    1e-6);
    }
}

static void zeros_around_and_no_snr_leave_numbers(void **state)
{
    (void)state;
    static const double snrs[3] = {0.0, 1e-30, 1e30};
    for (int q = 0; q < 3; q++) {
        float v[VOXELS] = {0};
        struct peak_fit fit;
        v[voxel_at(&grid, 3, 3, 3)] = 1.0f;
        peak_fit(&grid, v, voxel_at(&grid, 3, 3, 3), snrs[q], PEAK_ZERO_EMPTY, NULL,
                 &fit);
        expect_sound(&fit);
        for (int a = 0; a < 3; a++)
            assert_near(fit.position_m[a], grid.origin_m[a] + 3.0 * grid.step_m[a], 1e-9);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_gaussian_is_found_between_the_voxels),
        cmocka_unit_test(a_tilted_gaussian_is_found_between_the_voxels),
        cmocka_unit_test(the_covariance_is_the_shape_over_the_snr),
        cmocka_unit_test(noisy_peaks_scatter_as_their_covariance_says),
        cmocka_unit_test(the_scale_of_the_intensity_does_not_matter),
        cmocka_unit_test(on_the_rim_an_axis_stays_on_its_voxel),
        cmocka_unit_test(where_the_gate_ends_an_axis_is_not_known),
        cmocka_unit_test(beside_emptiness_an_axis_is_known_to_a_voxel),
        cmocka_unit_test(a_turned_ridge_is_known_across_it_alone),
        cmocka_unit_test(a_ridge_stays_on_its_voxel_along_itself),
        cmocka_unit_test(a_long_tilted_ridge_is_not_left),
        cmocka_unit_test(a_voxel_that_is_no_peak_stays_where_it_is),
        cmocka_unit_test(one_voxel_is_its_own_peak),
        cmocka_unit_test(zeros_around_and_no_snr_leave_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
