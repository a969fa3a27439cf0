/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "tests/recon/rig.h"

static void a_point_is_where_it_is(void **state)
{
    (void)state;
    static const double places[6][3] = {{0.0, 0.0, 1.1},     {0.0137, -0.0241, 1.0531},
                                        {-0.1, 0.0, 1.2017}, {0.0, 0.1, 1.2},
                                        {0.12, -0.11, 1.3},  {-0.05, 0.07, 1.451}};
    for (int q = 0; q < 6; q++) {
        struct rig r;
        rig_default(&r);
        rig_look_at(&r, places[q][0] + 0.004, places[q][1] - 0.003, places[q][2] + 0.0017,
                    15, 0.008);
        rig_expect_point(&r, "fast", places[q], 2e-3, 1e-3);
    }
}

static void uneven_lines_of_midpoints_image_as_well(void **state)
{
    (void)state;
    static const double stage_m[8] = {-0.16, -0.13, -0.09, -0.02, 0.01, 0.05, 0.12, 0.15};
    static const double mics_m[4] = {-0.11, -0.02, 0.045, 0.1};
    const double at[3] = {-0.031, 0.043, 1.1523};
    struct rig r;
    rig_default(&r);
    memcpy(r.positions_m, stage_m, sizeof stage_m);
    for (size_t e = 0; e < 4; e++)
        r.microphones_m[e][1] = mics_m[e];
    rig_look_at(&r, -0.03, 0.04, 1.15, 15, 0.008);
    rig_expect_point(&r, "fast", at, 2e-3, 1e-3);
}

/* Up to 8 mm beside the line, a quarter of a wavelength: static corrections. */
static void elements_beside_the_line_image_as_well(void **state)
{
    (void)state;
    const double at[3] = {-0.031, 0.043, 1.1523};
    struct rig r;
    rig_default(&r);
    for (size_t e = 0; e < r.geometry.n_speakers; e++) {
        r.speakers_m[e][0] += e % 2 ? 0.005 : -0.005;
        r.speakers_m[e][1] += e % 3 ? 0.004 : -0.006;
        r.speakers_m[e][2] += e % 2 ? -0.008 : 0.008;
    }
    for (size_t e = 0; e < r.geometry.n_microphones; e++)
        r.microphones_m[e][2] += e < 2 ? 0.007 : -0.005;
    rig_look_at(&r, -0.03, 0.04, 1.15, 15, 0.008);
    rig_expect_point(&r, "fast", at, 2e-3, 1e-3);
}

/* A line of midpoints has no aperture across: a point beside it shows on the line at its
 * range, and the image's copies must stay away from it however narrow the grid is. */
static void a_single_line_of_midpoints_does_not_wrap(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.geometry.n_positions = 1;
    double x_m = r.geometry.stage_positions_m[0] +
                 0.5 * (r.speakers_m[0][0] + r.microphones_m[0][0]);
    const struct scatterer point = {{x_m + 0.11, 0.02, 1.2}, 1.0};
    rig_look_at(&r, x_m + 0.02, 0.02, 1.2, 19, 0.008);
    r.grid.n[0] = 5;
    r.grid.origin_m[0] = x_m;
    r.grid.step_m[0] = 0.02;
    float *image = rig_image(&r, "fast", &point, 1, 1);
    float strongest = 0.0f;
    size_t at = 0;
    for (size_t v = 0; v < grid_size(&r.grid); v += r.grid.n[0]) {
        at = image[v] > strongest ? v : at;
        strongest = fmaxf(image[v], strongest);
    }
    free(image);
    size_t z = at / (r.grid.n[0] * r.grid.n[1]);
    assert_near(r.grid.origin_m[2] + 0.008 * (double)z, hypot(1.2, 0.11), 0.008);
}

static void expect_refused(const struct rig *r)
{
    struct pool *pool;
    struct imager *im = NULL;
    const char *why = NULL;
    assert_int_equal(pool_create(&pool, 1), 0);
    assert_int_equal(rig_try(r, "fast", pool, &im, &why), -ENOTSUP);
    assert_null(im);
    assert_non_null(why);
    assert_true(strlen(why) > 5);
    assert_int_equal(rig_try(r, "fast", pool, &im, NULL), -ENOTSUP);
    pool_destroy(pool);
}

static void an_array_that_is_not_plane_is_refused_with_a_reason(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    r.speakers_m[1][2] = 0.04; /* 3.5 cm from the line of all */
    expect_refused(&r);
}

static void a_volume_behind_the_array_is_refused_with_a_reason(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    rig_look_at(&r, 0.0, 0.0, -1.1, 9, 0.01);
    expect_refused(&r);
    rig_default(&r);
    rig_look_at(&r, 0.0, 0.0, 0.0, 9, 0.01); /* astride its plane */
    expect_refused(&r);
}

/* The loud point would drown the far one by 40 dB. */
static void what_comes_before_the_gate_is_muted(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{0.02, 0.01, 1.3}, 1.0},
                                        {{0.0, 0.0, 0.85}, 100.0}};
    struct rig r;
    rig_default(&r);
    r.gate_m[0] = 1.05;
    rig_look_at(&r, 0.02, 0.01, 1.3, 11, 0.01);
    float *far = rig_image(&r, "fast", &points[0], 1, 1);
    float *both = rig_image(&r, "fast", points, 2, 1);
    assert_below(rig_difference(&r, far, both), 0.02);
    free(far);
    free(both);
}

/* The lower half of the band, of echoes that lie in some band of their own. */
static float *image_low(struct rig *r, const double echo_hz[2], bool taper)
{
    static const struct scatterer point = {{0.0, 0.0, 1.1}, 1.0};
    static const double low_hz[2] = {2e3, 1e4};
    struct imager_options options;
    struct pool *pool;
    struct imager *im;
    const char *why;
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    assert_non_null(image);
    assert_int_equal(pool_create(&pool, 1), 0);
    imager_options_default(&options);
    options.taper = taper;
    const struct imager_config cfg = {.method = "fast",
                                      .geometry = &r->geometry,
                                      .format = r->format,
                                      .band_hz = {low_hz[0], low_hz[1]},
                                      .gate_m = {r->gate_m[0], r->gate_m[1]},
                                      .grid = r->grid,
                                      .options = &options,
                                      .pool = pool};
    assert_int_equal(imager_create(&im, &cfg, &why), 0);
    memcpy(r->band_hz, echo_hz, sizeof r->band_hz);
    rig_add(r, im, &point, 1);
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    return image;
}

static float brightest(const struct rig *r, const float *image)
{
    float most = 0.0f;
    for (size_t q = 0; q < grid_size(&r->grid); q++) {
        assert_true(isfinite(image[q]));
        most = fmaxf(most, image[q]);
    }
    return most;
}

static void sounds_above_the_imaged_band_do_not_fold_into_it(void **state)
{
    (void)state;
    static const double inside_hz[2] = {2e3, 1e4}, above_hz[2] = {1.1e4, 2e4};
    struct rig r;
    rig_default(&r);
    float *seen = image_low(&r, inside_hz, false), *dark = image_low(&r, above_hz, false);
    assert_below(brightest(&r, dark), 1e-4f * brightest(&r, seen));
    free(seen);
    free(dark);
}

/* Cut off where the chirp is loudest, the pulse rings with 1 / x; Hann's falls with 1 /
 * x^3.  Beyond twice the pulse's width, 2 c / B. */
static void a_band_that_ends_softly_rings_less_in_depth(void **state)
{
    (void)state;
    static const double all_hz[2] = {2e3, 2e4};
    double ringing[2];
    for (int taper = 0; taper < 2; taper++) {
        struct rig r;
        rig_default(&r);
        rig_look_at(&r, 0.0, 0.0, 1.1, 41, 0.008);
        float *image = image_low(&r, all_hz, taper);
        const struct grid *g = &r.grid;
        size_t column = g->n[1] / 2 * g->n[0] + g->n[0] / 2, plane = g->n[0] * g->n[1];
        float most = 0.0f;
        for (size_t z = 0; z < g->n[2]; z++)
            if (fabs(g->origin_m[2] + g->step_m[2] * (double)z - 1.1) >
                2.0 * r.geometry.sound_speed_m_s / 8e3)
                most = fmaxf(most, image[z * plane + column]);
        ringing[taper] = most / brightest(&r, image);
        free(image);
    }
    assert_below(ringing[1], 0.25 * ringing[0]);
}

static void the_number_of_threads_hardly_matters(void **state)
{
    (void)state;
    const struct scatterer point = {{0.03, -0.02, 1.1}, 1.0};
    struct rig r;
    rig_default(&r);
    float *one = rig_image(&r, "fast", &point, 1, 1);
    for (size_t n = 2; n <= 3; n++) {
        float *image = rig_image(&r, "fast", &point, 1, n);
        assert_below(rig_difference(&r, one, image), 1e-5);
        free(image);
    }
    free(one);
}

/* Far from a small array moveout is as good as exact, and both methods see nearly the
 * same: migration weighs high frequencies more, so its points are a little smaller. */
static void it_sees_what_backprojection_sees(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{0.03, -0.02, 1.2}, 1.0},
                                        {{-0.09, 0.06, 1.25}, 0.9}};
    struct rig r;
    struct peak_fit fast_fit, slow_fit;
    rig_default(&r);
    rig_look_at(&r, 0.0, 0.0, 1.22, 21, 0.01);
    float *fast = rig_image(&r, "fast", points, 2, 1);
    float *slow = rig_image(&r, "backprojection", points, 2, 1);
    double ab = 0.0, aa = 0.0, bb = 0.0;
    for (size_t v = 0; v < grid_size(&r.grid); v++) {
        ab += sqrt((double)fast[v] * slow[v]);
        aa += fast[v];
        bb += slow[v];
    }
    assert_below(0.9, ab / sqrt(aa * bb));
    rig_peak(&r, fast, &fast_fit);
    rig_peak(&r, slow, &slow_fit);
    for (int a = 0; a < 3; a++) {
        assert_near(fast_fit.position_m[a], slow_fit.position_m[a], 2e-3);
        assert_near(fast_fit.width_m[a] / slow_fit.width_m[a], 1.0, 0.25);
    }
    free(fast);
    free(slow);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_is_where_it_is),
        cmocka_unit_test(uneven_lines_of_midpoints_image_as_well),
        cmocka_unit_test(elements_beside_the_line_image_as_well),
        cmocka_unit_test(a_single_line_of_midpoints_does_not_wrap),
        cmocka_unit_test(an_array_that_is_not_plane_is_refused_with_a_reason),
        cmocka_unit_test(a_volume_behind_the_array_is_refused_with_a_reason),
        cmocka_unit_test(what_comes_before_the_gate_is_muted),
        cmocka_unit_test(sounds_above_the_imaged_band_do_not_fold_into_it),
        cmocka_unit_test(a_band_that_ends_softly_rings_less_in_depth),
        cmocka_unit_test(the_number_of_threads_hardly_matters),
        cmocka_unit_test(it_sees_what_backprojection_sees),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
