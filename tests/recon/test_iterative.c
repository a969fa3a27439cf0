/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/inverse/iterative.h"
#include "recon/inverse/psf.h"
#include "tests/recon/hard.h"
#include "tests/recon/rig.h"

/* A few iterations: what is asked here does not wait for the last digit. */
static struct imager *imager_of(const struct rig *r, const char *base,
                                const struct psf *measured, struct pool *pool)
{
    struct imager_options options;
    struct imager *im;
    imager_options_default(&options);
    options.base = base;
    options.iterations = 40;
    options.psf = measured;
    const struct imager_config cfg = {
        .method = "iterative",
        .geometry = &r->geometry,
        .format = r->format,
        .band_hz = {r->band_hz[0], r->band_hz[1]},
        .gate_m = {r->gate_m[0], r->gate_m[1]},
        .grid = r->grid,
        .options = &options,
        .pool = pool,
    };
    assert_int_equal(imager_create(&im, &cfg, NULL), 0);
    return im;
}

static float *image_by(const struct rig *r, const char *base, const struct psf *measured,
                       const struct scatterer *points, size_t n_points, size_t threads)
{
    struct pool *pool;
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    assert_non_null(image);
    assert_int_equal(pool_create(&pool, threads), 0);
    struct imager *im = imager_of(r, base, measured, pool);
    rig_add(r, im, points, n_points);
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    return image;
}

static float *image_of(const struct rig *r, const char *base,
                       const struct scatterer *points, size_t n_points, size_t threads)
{
    return image_by(r, base, NULL, points, n_points, threads);
}

static const char *const bases[3] = {"fast", "backprojection", "lct"};

/* Voxels are 12 mm wide and 5 mm deep; a point takes two or three. */
static void a_point_between_voxels_is_where_it_is(void **state)
{
    (void)state;
    static const double places[4][3] = {{0.0, 0.0, 1.1},
                                        {0.006, -0.006, 1.1025},
                                        {-0.021, 0.015, 1.0985},
                                        {0.033, 0.039, 1.111}};
    struct rig r;
    rig_default(&r);
    for (int p = 0; p < 4; p++)
        rig_expect_point(&r, "iterative", places[p], 0.003, 0.001);
}

/* Voxels above a quarter of the largest. */
static size_t bright_voxels(const struct rig *r, const float *image)
{
    float most = 0.0f;
    size_t n = 0;
    for (size_t v = 0; v < grid_size(&r->grid); v++) {
        assert_true(isfinite(image[v]));
        most = fmaxf(most, image[v]);
    }
    assert_true(most > 0.0f);
    for (size_t v = 0; v < grid_size(&r->grid); v++)
        n += image[v] > 0.25f * most;
    return n;
}

static void a_point_is_smaller_than_in_the_image_it_is_made_of(void **state)
{
    (void)state;
    const struct scatterer point = {{0.006, -0.006, 1.1}, 1.0};
    struct rig r;
    rig_default(&r);
    float *before = rig_image(&r, "fast", &point, 1, 1);
    float *after = image_of(&r, "fast", &point, 1, 1);
    assert_true(bright_voxels(&r, after) * 10 < bright_voxels(&r, before) * 9);
    free(before);
    free(after);
}

/* Brightest of the volume that is left when it has one voxel, at a point, along the axes
 * of the mask. */
static double brightest_of(const char *method, unsigned lone)
{
    const double at_m[3] = {0.0, 0.0, 1.1};
    const struct scatterer point = {{at_m[0], at_m[1], at_m[2]}, 1.0};
    struct rig r;
    double most = 0.0;
    rig_default(&r);
    for (int a = 0; a < 3; a++)
        if (lone >> a & 1u) {
            r.grid.n[a] = 1;
            r.grid.origin_m[a] = at_m[a];
        }
    float *image = !strcmp(method, "iterative") ? image_of(&r, "fast", &point, 1, 1)
                                                : rig_image(&r, method, &point, 1, 1);
    for (size_t v = 0; v < grid_size(&r.grid); v++)
        most = fmax(most, (double)image[v]);
    free(image);
    return most;
}

/* Nothing there is blurred into anything else, so that of (x - a)^2 / 2 + l1 a x the
 * least is at a (1 - l1): amplitudes, of which the image has the squares. */
static void a_lone_voxel_is_as_bright_as_it_is_but_for_l1(void **state)
{
    (void)state;
    struct imager_options o;
    imager_options_default(&o);
    double expected = (1.0 - o.l1) * (1.0 - o.l1) * brightest_of("fast", 7);
    assert_near(brightest_of("iterative", 7), expected, 0.01 * expected);
}

/* A section through a point is sharpened along fewer axes, which may cost it some dB, but
 * not half of its amplitude. */
static void a_section_is_as_bright_as_the_volume(void **state)
{
    (void)state;
    double whole = brightest_of("iterative", 0);
    for (unsigned lone = 1; lone < 7; lone++) {
        double db = 10.0 * log10(brightest_of("iterative", lone) / whole);
        print_message("one voxel along axes %x: %.1f dB\n", lone, db);
        assert_near(db, 0.0, 6.0);
    }
}

/* Power resolves 20 cm here; its middle is still where the point is. */
static void the_light_cone_operator_finds_a_point(void **state)
{
    (void)state;
    const struct scatterer point = {{0.02, -0.03, 1.1}, 1.0};
    struct rig r;
    struct peak_fit fit;
    rig_default(&r);
    float *image = image_of(&r, "lct", &point, 1, 2);
    rig_peak(&r, image, &fit);
    free(image);
    assert_near(fit.position_m[0], 0.02, 0.02);
    assert_near(fit.position_m[1], -0.03, 0.02);
    assert_near(fit.position_m[2], 1.1, 0.01);
}

/* -- a measured point spread function --------------------------------------------------
 */

static void look_at_range(struct rig *r, double range_m)
{
    rig_default(r);
    rig_listen(r, 0.7, 2.6);
    r->gate_m[1] = 2.6;
    rig_look_at(r, 0.0, 0.0, range_m, 25, 0.0115 * range_m);
    r->grid.n[2] = 13;
    r->grid.step_m[2] = 0.005;
    r->grid.origin_m[2] = range_m - 6 * 0.005;
}

static void measure(double range_m, struct psf *out)
{
    const struct scatterer point = {{0.0, 0.0, range_m}, 1.0};
    struct rig r;
    struct peak_fit fit;
    look_at_range(&r, range_m);
    float *image = rig_image(&r, "fast", &point, 1, 2);
    size_t middle = (6 * 25 + 12) * 25 + 12;
    assert_true(rig_peak(&r, image, &fit) == image[middle]);
    assert_int_equal(psf_fit(out, &r.grid, image, middle), 0);
    free(image);
}

/* Measured at half the range it does there what one measured there does; as if it had
 * been measured there, it is too narrow. */
static void a_function_measured_elsewhere_is_widened_by_the_range(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{-0.1, 0.0, 2.2}, 1.0}, {{0.1, 0.05, 2.2}, 0.7}};
    struct psf near, far, misplaced;
    struct rig r;
    measure(1.1, &near);
    measure(2.2, &far);
    misplaced = near;
    misplaced.centre_m[2] = far.centre_m[2];
    look_at_range(&r, 2.2);
    float *expected = image_by(&r, "fast", &far, points, 2, 2);
    float *widened = image_by(&r, "fast", &near, points, 2, 2);
    float *narrow = image_by(&r, "fast", &misplaced, points, 2, 2);
    assert_below(rig_difference(&r, expected, widened), 0.03);
    assert_below(0.3, rig_difference(&r, expected, narrow));
    assert_true(bright_voxels(&r, narrow) * 4 > bright_voxels(&r, widened) * 5);
    free(expected);
    free(widened);
    free(narrow);
}

/* -- on every base ----------------------------------------------------------------------
 */

/* An array that each of them accepts. */
static void every_base(void (*check)(const struct hard *h, const char *base))
{
    struct hard h;
    size_t n = 0;
    hard_create(&h, 343.0, 10, 8, 8);
    for (const char *base = imager_methods(); *base; base += strlen(base) + 1) {
        if (!strcmp(base, "iterative"))
            continue;
        check(&h, base);
        n++;
    }
    assert_int_equal(n, 7);
    hard_clear(&h);
}

static float *image_louder(const struct hard *h, const char *base, float gain)
{
    const struct rig *r = &h->rig;
    size_t n_speakers = r->geometry.n_speakers;
    size_t n = r->geometry.n_microphones * r->format.n_samples;
    struct pool *pool;
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    float complex *traces = malloc(n * sizeof *traces);
    assert_true(image && traces);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager *im = imager_of(r, base, NULL, pool);
    for (size_t p = 0; p < hard_pings(h); p++) {
        const float complex *heard = hard_trace(h, p, 0);
        for (size_t q = 0; q < n; q++)
            traces[q] = gain * heard[q];
        assert_true(imager_add(im, p / n_speakers, p % n_speakers, traces, NULL));
    }
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    free(traces);
    return image;
}

/* As near as in the image of the base, and half a voxel. */
static void expect_point(const struct hard *h, const char *base)
{
    struct hard_limits limits;
    struct peak_fit fit;
    hard_limits(base, &limits);
    float *image = image_louder(h, base, 1.0f);
    float most = rig_peak(&h->rig, image, &fit);
    free(image);
    if (!(most > 0.0f))
        fail_msg("%s: the image is dark", base);
    for (int a = 0; a < 3; a++) {
        double limit_m = a < 2 ? limits.lateral_m : limits.depth_m;
        limit_m += 0.5 * h->rig.grid.step_m[a];
        if (!(fabs(fit.position_m[a] - h->point.at_m[a]) <= limit_m))
            fail_msg("%s: at %.4f along %c, not within %.4f of %.4f", base,
                     fit.position_m[a], "xyz"[a], limit_m, h -> point.at_m[a]);
    }
}

static void a_point_is_where_it_is(void **state)
{
    (void)state;
    every_base(expect_point);
}

static void expect_scaled(const struct hard *h, const char *base)
{
    static const float gains[2] = {1e-6f, 30.0f};
    float *one = image_louder(h, base, 1.0f);
    for (int g = 0; g < 2; g++) {
        float *other = image_louder(h, base, gains[g]);
        for (size_t v = 0; v < grid_size(&h->rig.grid); v++)
            other[v] = (float)((double)other[v] / gains[g] / gains[g]);
        double difference = rig_difference(&h->rig, one, other);
        if (!(difference < 1e-3))
            fail_msg("%s: off by %.2g of the maximum at a gain of %g", base, difference,
                     gains[g]);
        free(other);
    }
    free(one);
}

static void the_gain_of_the_recording_only_scales_it(void **state)
{
    (void)state;
    every_base(expect_scaled);
}

static void silence_gives_a_silent_image(void **state)
{
    (void)state;
    const struct scatterer nothing = {{0.0, 0.0, 1.1}, 0.0};
    struct rig r;
    rig_default(&r);
    for (int b = 0; b < 3; b++) {
        float *image = image_of(&r, bases[b], &nothing, 1, 2);
        for (size_t v = 0; v < grid_size(&r.grid); v++)
            assert_true(image[v] == 0.0f);
        free(image);
    }
}

static void threads_do_not_change_it(void **state)
{
    (void)state;
    const struct scatterer points[2] = {{{-0.03, 0.01, 1.1}, 1.0},
                                        {{0.03, 0.0, 1.12}, 0.7}};
    struct rig r;
    rig_default(&r);
    for (int b = 0; b < 3; b += 2) {
        float *one = image_of(&r, bases[b], points, 2, 1);
        float *three = image_of(&r, bases[b], points, 2, 3);
        assert_memory_equal(one, three, grid_size(&r.grid) * sizeof *one);
        free(one);
        free(three);
    }
}

/* The sum, the middle, and 1/4 voxel^2 of variance along each axis. */
static void the_beam_keeps_the_middle(void **state)
{
    (void)state;
    static const size_t n[3] = {7, 5, 6};
    float x[7 * 5 * 6] = {0}, spare[7 * 5 * 6];
    double sum = 0.0, middle[3] = {0}, square[3] = {0};
    x[(2 * 5 + 2) * 7 + 3] = 2.0f;
    x[(2 * 5 + 2) * 7 + 4] = 1.0f;
    iterative_beam(n, x, spare);
    for (size_t i = 0; i < 7 * 5 * 6; i++) {
        size_t at[3] = {i % 7, i / 7 % 5, i / 35};
        sum += (double)x[i];
        for (int a = 0; a < 3; a++) {
            middle[a] += (double)x[i] * (double)at[a] / 3.0;
            square[a] += (double)x[i] * (double)(at[a] * at[a]) / 3.0;
        }
    }
    assert_near(sum, 3.0, 1e-6);
    assert_near(middle[0], 10.0 / 3.0, 1e-6);
    assert_near(middle[1], 2.0, 1e-6);
    assert_near(middle[2], 2.0, 1e-6);
    assert_near(square[0] - middle[0] * middle[0], 2.0 / 9.0 + 0.25, 1e-5);
    assert_near(square[1] - 4.0, 0.25, 1e-5);
    assert_near(square[2] - 4.0, 0.25, 1e-5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_point_between_voxels_is_where_it_is),
        cmocka_unit_test(a_point_is_smaller_than_in_the_image_it_is_made_of),
        cmocka_unit_test(a_lone_voxel_is_as_bright_as_it_is_but_for_l1),
        cmocka_unit_test(a_section_is_as_bright_as_the_volume),
        cmocka_unit_test(the_light_cone_operator_finds_a_point),
        cmocka_unit_test(a_function_measured_elsewhere_is_widened_by_the_range),
        cmocka_unit_test(a_point_is_where_it_is),
        cmocka_unit_test(the_gain_of_the_recording_only_scales_it),
        cmocka_unit_test(silence_gives_a_silent_image),
        cmocka_unit_test(threads_do_not_change_it),
        cmocka_unit_test(the_beam_keeps_the_middle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
