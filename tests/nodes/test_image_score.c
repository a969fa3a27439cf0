/* SPDX-License-Identifier: MIT */
/* The errors of `anlos speed-error`, on images whose errors follow from how they were
 * made, and on the reference's definitions where these decide (edges that lie on pixels).
 */
#include <errno.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "nodes/anlos/speed_error/noise.h"
#include "nodes/anlos/speed_error/score.h"
#include "tests/nodes/near.h"

static const double footprint[4] = {0.06, 1.025, 0.02, 0.965};

static double at(const struct grid *g, int axis, size_t i)
{
    return g->origin_m[axis] + g->step_m[axis] * (double)i;
}

/* Adds a Gaussian spot of given standard deviations. */
static void add_spot(const struct grid *g, float *v, const double c[3],
                     const double sigma[3], double height)
{
    for (size_t q = 0; q < grid_size(g); q++) {
        double x = (at(g, 0, q % g->n[0]) - c[0]) / sigma[0];
        double y = (at(g, 1, q / g->n[0] % g->n[1]) - c[1]) / sigma[1];
        double z = (at(g, 2, q / (g->n[0] * g->n[1])) - c[2]) / sigma[2];
        v[q] += (float)(height * exp(-0.5 * (x * x + y * y + z * z)));
    }
}

/* The logarithm of a Gaussian is a parabola, so its place is found exactly; at -6 dB it
 * is 2 sqrt(2 ln 4) = 3.330 standard deviations wide. */
static void a_shifted_spot_has_its_shift_and_width(void **state)
{
    (void)state;
    struct grid g = {{0, 0, 2}, {0.01, 0.01, 0.005}, {81, 61, 81}};
    struct bench_truth t = {.n_points = 1, .points_m = {{0.4, 0.3, 2.2}}};
    const double c[3] = {0.403, 0.296, 2.2015}, sigma[3] = {0.02, 0.025, 0.01};
    float *v = calloc(grid_size(&g), sizeof *v);
    struct bench_score s;
    add_spot(&g, v, c, sigma, 1.0);
    add_spot(&g, v, (double[3]){0.7, 0.5, 2.3}, sigma, 0.01);
    assert_int_equal(bench_score(&s, &t, footprint, &g, v), 0);
    assert_near(s.lateral_m, 0.005, 1e-5);
    assert_near(s.lateral_worst_m, 0.005, 1e-5);
    assert_near(s.depth_m, 0.0015, 1e-5);
    for (int a = 0; a < 3;
         a++) /* of the voxel, which is below the peak: a little wider */
        assert_near(s.width_m[a], 2.0 * sqrt(2.0 * log(4.0)) * sigma[a], 0.06 * sigma[a]);
    /* the peak lies off its voxel, by so many standard deviations */
    const double off = 0.15 * 0.15 + 0.16 * 0.16 + 0.15 * 0.15;
    assert_near(s.sidelobe_db, 20.0 - 5.0 * off / log(10.0), 1e-3);
    assert_near(bench_score_error(&s), 0.5, 1e-3);
    assert_true(isnan(s.iou));
    free(v);
}

static void of_two_points_the_mean_and_the_worst_count(void **state)
{
    (void)state;
    struct grid g = {{0, 0, 2}, {0.01, 0.01, 0.01}, {101, 61, 41}};
    struct bench_truth t = {.n_points = 2,
                            .points_m = {{0.3, 0.3, 2.2}, {0.7, 0.3, 2.2}}};
    const double sigma[3] = {0.02, 0.02, 0.02};
    float *v = calloc(grid_size(&g), sizeof *v);
    struct bench_score s;
    add_spot(&g, v, (double[3]){0.302, 0.3, 2.2}, sigma, 1.0);
    add_spot(&g, v, (double[3]){0.7, 0.306, 2.2}, sigma, 0.1);
    add_spot(&g, v, (double[3]){0.5, 0.55, 2.2}, sigma, 0.05);
    assert_int_equal(bench_score(&s, &t, footprint, &g, v), 0);
    assert_near(s.lateral_m, 0.004, 1e-5);
    assert_near(s.lateral_worst_m, 0.006, 1e-5);
    assert_near(s.sidelobe_db, 10.0 * log10(2.0), 0.3); /* the fainter one counts */
    free(v);
}

static void a_point_outside_the_image_has_no_error(void **state)
{
    (void)state;
    struct grid g = {{0, 0, 2}, {0.01, 0.01, 0.01}, {5, 5, 5}};
    struct bench_truth t = {.n_points = 1, .points_m = {{3, 3, 3}}}, none = {0};
    float v[125] = {1.0f};
    struct bench_score s;
    assert_int_equal(bench_score(&s, &t, footprint, &g, v), 0);
    assert_true(isnan(s.lateral_m));
    assert_int_equal(bench_score(&s, &none, footprint, &g, v), -EINVAL);
}

/* A plane of pixels that are the reference's: bright between columns and rows. */
static float *paint(struct grid *g, size_t x0, size_t x1, size_t y0, size_t y1)
{
    *g = (struct grid){{0.06, 0.02, 2.0}, {0.01, 0.01, 0.1}, {97, 95, 2}};
    float *v = calloc(grid_size(g), sizeof *v);
    for (size_t y = y0; y < y1; y++)
        for (size_t x = x0; x < x1; x++)
            v[y * 97 + x] = 4.0f;
    return v;
}

/* 30 x 40 pixels against a mask of 40 x 40 that they share 20 x 40 with: 800 of 2000. */
static void overlapping_rectangles_have_their_iou_and_correlation(void **state)
{
    (void)state;
    struct grid g;
    float *v = paint(&g, 10, 40, 20, 60);
    struct bench_truth t = {.n_masks = 1,
                            .masks = {{.z_m = 2.0,
                                       .centre_m = {0.555, 0.415},
                                       .n_bars = 1,
                                       .bars_m = {{-0.2, 0.2, -0.2, 0.2}}}}};
    struct bench_score s;
    /* columns .355 to .755 are pixels 30 to 69, rows .215 to .615 are 20 to 59 */
    const double n = 97.0 * 95.0, a = 1200.0, m = 1600.0, both = 400.0;
    assert_int_equal(bench_score(&s, &t, footprint, &g, v), 0);
    assert_near(s.iou, both / (a + m - both), 1e-12);
    assert_near(s.correlation,
                (both - a * m / n) / sqrt((a - a * a / n) * (m - m * m / n)), 1e-6);
    assert_near(bench_score_error(&s), 1.0 - s.iou, 0.0);
    assert_true(isnan(s.lateral_m));
    free(v);
}

static void what_lies_at_another_depth_does_not_count(void **state)
{
    (void)state;
    struct grid g;
    float *v = paint(&g, 30, 70, 20, 60);
    struct bench_truth t = {.n_masks = 1,
                            .masks = {{.z_m = 2.0,
                                       .centre_m = {0.555, 0.415},
                                       .n_bars = 1,
                                       .bars_m = {{-0.2, 0.2, -0.2, 0.2}}}}};
    struct bench_score s;
    g.step_m[2] = 0.2; /* the second plane is 20 cm behind the letter */
    for (size_t q = 97 * 95; q < 2 * 97 * 95; q++)
        v[q] = 100.0f;
    assert_int_equal(bench_score(&s, &t, footprint, &g, v), 0);
    assert_near(s.iou, 1.0, 0.0);
    free(v);
}

static void a_letter_is_made_of_its_bars(void **state)
{
    (void)state;
    struct bench_truth t = {.n_masks = 1,
                            .masks = {{.z_m = 2.0, .centre_m = {0.5, 0.5}}}};
    const double size[2] = {0.4, 0.6};
    struct bench_mask *m = &t.masks[0];
    assert_int_equal(bench_mask_letter(m, 'H', size, 0.1), 0);
    assert_int_equal(m->n_bars, 3);
    assert_true(bench_truth_covers(&t, 0.32, 0.78));
    assert_true(bench_truth_covers(&t, 0.68, 0.22));
    assert_true(bench_truth_covers(&t, 0.5, 0.5));
    assert_false(bench_truth_covers(&t, 0.5, 0.7));
    assert_false(bench_truth_covers(&t, 0.29, 0.5));
    assert_int_equal(bench_mask_letter(m, 'T', size, 0.1), 0);
    assert_true(bench_truth_covers(&t, 0.32, 0.78));
    assert_false(bench_truth_covers(&t, 0.32, 0.5));
    assert_int_equal(bench_mask_letter(m, 'X', size, 0.1), -EINVAL);
}

static void the_window_lies_inside_the_footprint(void **state)
{
    (void)state;
    const double speakers[2][3] = {{0, 0, 0}, {0, 1, 0}},
                 microphones[2][3] = {{0.08, 0, 0}, {0.08, 1, 0}};
    const double positions[2] = {0, 1};
    struct geometry g = {.n_speakers = 2,
                         .n_microphones = 2,
                         .n_positions = 2,
                         .speakers_m = speakers,
                         .microphones_m = microphones,
                         .stage_axis = {1, 0, 0},
                         .stage_positions_m = positions};
    double w[4];
    bench_score_window(w, &g);
    for (int i = 0; i < 4; i++)
        assert_near(w[i], footprint[i], 1e-12);
}

/* -- the bound --------------------------------------------------------------------------
 */

/* Four co-located pairs at (+-h, 0), (0, +-h) before a point at distance r: with s = h /
 * R and k = r / R, grad tau = 2 / c (-+s, -+s, k), so J = w f2 (4 / c^2) diag(2 s^2, 2
 * s^2, 4 k^2), w = (2 pi)^2 SNR; not to know the phase leaves f2 - f1^2 in depth alone.
 */
static void the_bound_of_a_cross_is_the_one_by_hand(void **state)
{
    (void)state;
    const double h = 0.5, r = 2.0, c = 340.0, f0 = 2000.0, f1 = 20000.0,
                 snr[4] = {1, 1, 1, 1};
    const double places[4][2][3] = {{{h, 0, 0}, {h, 0, 0}},
                                    {{-h, 0, 0}, {-h, 0, 0}},
                                    {{0, h, 0}, {0, h, 0}},
                                    {{0, -h, 0}, {0, -h, 0}}};
    const double at_m[3] = {0, 0, r}, band_hz[2] = {f0, f1};
    struct geometry g = {.sound_speed_m_s = c,
                         .n_speakers = 1,
                         .n_microphones = 1,
                         .n_positions = 4,
                         .pings_m = places};
    double slant = hypot(h, r), w = 4.0 * M_PI * M_PI * 4.0 / (c * c);
    /* the mean of f^2 and of f over the band, by summing */
    double square = 0.0, mean = 0.0;
    for (int i = 0; i < 100000; i++) {
        double f = f0 + (f1 - f0) * (i + 0.5) / 100000.0;
        square += f * f / 100000.0;
        mean += f / 100000.0;
    }
    double lateral = sqrt(2.0 / (w * square * 2.0 * h * h / (slant * slant)));
    double along = 4.0 * r * r / (slant * slant);
    struct bench_bound b;
    assert_int_equal(bench_bound(&b, &g, at_m, band_hz, true, snr), 0);
    assert_near(b.lateral_m / lateral, 1.0, 1e-6);
    assert_near(b.depth_m * sqrt(w * square * along), 1.0, 1e-6);
    assert_int_equal(bench_bound(&b, &g, at_m, band_hz, false, snr), 0);
    assert_near(b.lateral_m / lateral, 1.0, 1e-6);
    assert_near(b.depth_m * sqrt(w * (square - mean * mean) * along), 1.0, 1e-6);
}

static void one_line_of_pairs_has_no_bound(void **state)
{
    (void)state;
    const double places[2][2][3] = {{{0.5, 0, 0}, {0.5, 0, 0}},
                                    {{-0.5, 0, 0}, {-0.5, 0, 0}}};
    const double at_m[3] = {0, 0, 2}, band_hz[2] = {2000, 20000}, snr[2] = {1, 1};
    struct geometry g = {.sound_speed_m_s = 340,
                         .n_speakers = 1,
                         .n_microphones = 1,
                         .n_positions = 2,
                         .pings_m = places};
    struct bench_bound b;
    assert_int_equal(bench_bound(&b, &g, at_m, band_hz, true, snr), -EDOM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_shifted_spot_has_its_shift_and_width),
        cmocka_unit_test(of_two_points_the_mean_and_the_worst_count),
        cmocka_unit_test(a_point_outside_the_image_has_no_error),
        cmocka_unit_test(overlapping_rectangles_have_their_iou_and_correlation),
        cmocka_unit_test(what_lies_at_another_depth_does_not_count),
        cmocka_unit_test(a_letter_is_made_of_its_bars),
        cmocka_unit_test(the_window_lies_inside_the_footprint),
        cmocka_unit_test(the_bound_of_a_cross_is_the_one_by_hand),
        cmocka_unit_test(one_line_of_pairs_has_no_bound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
