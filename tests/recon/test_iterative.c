#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/iterative.h"
#include "tests/recon/rig.h"

/* A few iterations: what is asked here does not wait for the last digit. */
static float *image_of(const struct rig *r, const char *base,
                       const struct scatterer *points, size_t n_points, size_t threads)
{
    struct imager_options options;
    struct pool *pool;
    struct imager *im;
    imager_options_default(&options);
    options.base = base;
    options.iterations = 40;
    const struct imager_config cfg = {
        .method = "iterative",
        .geometry = &r->geometry,
        .format = r->format,
        .band_hz = {r->band_hz[0], r->band_hz[1]},
        .gate_m = {r->gate_m[0], r->gate_m[1]},
        .grid = r->grid,
        .options = &options,
    };
    struct imager_config own = cfg;
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    assert_int_equal(pool_create(&pool, threads), 0);
    own.pool = pool;
    assert_int_equal(imager_create(&im, &own, NULL), 0);
    rig_add(r, im, points, n_points);
    imager_image(im, image);
    imager_destroy(im);
    pool_destroy(pool);
    return image;
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

static void the_gain_of_the_recording_only_scales_it(void **state)
{
    (void)state;
    static const double gains[4] = {0.03, 30.0, 1e-6, 1e6};
    struct rig r;
    rig_default(&r);
    for (int b = 0; b < 3; b += 2) {
        int power = b == 2; /* the base is linear in the amplitude, or in the power */
        const struct scatterer points[2] = {{{-0.03, 0.0, 1.1}, 1.0},
                                            {{0.05, 0.02, 1.08}, 0.5}};
        float *one = image_of(&r, bases[b], points, 2, 1);
        for (int g = 0; g < 4; g++) {
            const struct scatterer louder[2] = {{{-0.03, 0.0, 1.1}, gains[g]},
                                                {{0.05, 0.02, 1.08}, 0.5 * gains[g]}};
            float *other = image_of(&r, bases[b], louder, 2, 1);
            for (size_t v = 0; v < grid_size(&r.grid); v++)
                other[v] = (float)((double)other[v] / gains[g] / gains[g]);
            assert_below(rig_difference(&r, one, other), power ? 5e-3 : 1e-3);
            free(other);
        }
        free(one);
    }
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
        cmocka_unit_test(the_light_cone_operator_finds_a_point),
        cmocka_unit_test(the_gain_of_the_recording_only_scales_it),
        cmocka_unit_test(silence_gives_a_silent_image),
        cmocka_unit_test(threads_do_not_change_it),
        cmocka_unit_test(the_beam_keeps_the_middle),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
