/* SPDX-License-Identifier: MIT */
/* What methods say of the image that they made. */
#include "tests/recon/near.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/recon/rig.h"

/* The image of a point in the middle of the grid, on the heap. */
static float *image_with(const struct rig *r, const char *method,
                         const struct imager_options *options, struct imager_outcome *out)
{
    const struct grid *g = &r->grid;
    struct scatterer point = {.gain = 1.0};
    struct pool *pool;
    struct imager *im;
    for (int a = 0; a < 3; a++)
        point.at_m[a] = g->origin_m[a] + g->step_m[a] * (double)(g->n[a] / 2);
    assert_int_equal(pool_create(&pool, 1), 0);
    struct imager_config cfg = rig_config(r, method, pool);
    cfg.options = options;
    assert_int_equal(imager_create(&im, &cfg, NULL), 0);
    rig_add(r, im, &point, 1);
    float *image = malloc(grid_size(&r->grid) * sizeof *image);
    imager_image(im, image);
    imager_outcome(im, out);
    imager_destroy(im);
    pool_destroy(pool);
    return image;
}

static void outcome_of(const char *method, const char *base, size_t iterations,
                       double tolerance, struct imager_outcome *out)
{
    struct imager_options o;
    struct rig r;
    rig_default(&r);
    imager_options_default(&o);
    o.base = base;
    o.iterations = iterations;
    o.tolerance = tolerance;
    free(image_with(&r, method, &o, out));
    assert_true(out->iterates);
}

static void iterations_that_suffice_have_converged(void **state)
{
    (void)state;
    static const char *const bases[] = {"fast", "backprojection", "lct"};
    struct imager_outcome out;
    for (size_t b = 0; b < sizeof bases / sizeof *bases; b++) {
        outcome_of("iterative", bases[b], 200, 0.05, &out);
        assert_true(out.converged);
        assert_true(out.residual > 0.0 && out.residual <= 0.05);
        assert_true(out.iterations > 0 && out.iterations < 200);
    }
    outcome_of("sparse", "fast", 200, 0.001, &out);
    assert_true(out.converged && out.iterations > 0);
    assert_true(out.residual >= 0.0 && out.residual <= 0.001);
}

static void too_few_iterations_have_not(void **state)
{
    (void)state;
    static const char *const bases[] = {"fast", "backprojection", "lct"};
    struct imager_outcome out;
    for (size_t b = 0; b < sizeof bases / sizeof *bases; b++) {
        outcome_of("iterative", bases[b], 3, 1e-6, &out);
        assert_false(out.converged);
        assert_int_equal(out.iterations, 3);
        assert_true(out.residual > 1e-6);
    }
    outcome_of("sparse", "fast", 1, 1e-9, &out);
    assert_false(out.converged);
    assert_true(out.iterations > 0 && out.residual > 0.0);
}

/* Of an option that is left to the method: the image is that of what it says it chose. */
static bool expect_choice(const struct rig *r, const char *method, const char *option)
{
    static const char *const words[3] = {"auto", "never", "always"};
    struct imager_outcome out[3];
    float *image[3];
    for (int i = 0; i < 3; i++) {
        struct imager_options o;
        char text[64], why[128];
        imager_options_default(&o);
        snprintf(text, sizeof text, "%s=%s", option, words[i]);
        assert_int_equal(imager_option_set(&o, text, why, sizeof why), 0);
        image[i] = image_with(r, method, &o, &out[i]);
        assert_string_equal(out[i].choice, option);
        assert_false(out[i].iterates);
    }
    assert_true(!out[1].chosen && out[2].chosen);
    size_t size = grid_size(&r->grid) * sizeof *image[0];
    assert_memory_equal(image[0], image[1 + out[0].chosen], size);
    assert_memory_not_equal(image[0], image[2 - out[0].chosen], size);
    for (int i = 0; i < 3; i++)
        free(image[i]);
    return out[0].chosen;
}

static void what_is_left_to_a_method_is_told(void **state)
{
    (void)state;
    struct rig r;
    rig_default(&r);
    assert_true(expect_choice(&r, "paper", "lightcone")); /* a point is no mirror */
    assert_false(expect_choice(&r, "fast", "dmo"));
    for (int i = 0; i < 4; i++) {
        r.speakers_m[i][1] *= 3.0;
        r.microphones_m[i][1] *= 3.0;
    }
    rig_look_at(&r, 0.0, 0.0, 0.5, 21, 0.04);
    rig_listen(&r, 0.3, 1.3);
    assert_true(expect_choice(&r, "fast", "dmo")); /* near so large an array */
}

static void what_iterative_sharpens_tells_its_choice_too(void **state)
{
    (void)state;
    struct imager_outcome out;
    outcome_of("iterative", "fast", 3, 1e-3, &out);
    assert_string_equal(out.choice, "dmo");
    outcome_of("iterative", "backprojection", 3, 1e-3, &out);
    assert_null(out.choice);
}

static void a_method_without_choices_tells_nothing(void **state)
{
    (void)state;
    struct imager_outcome out;
    struct rig r;
    rig_default(&r);
    free(image_with(&r, "backprojection", NULL, &out));
    assert_null(out.choice);
    assert_false(out.iterates);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(iterations_that_suffice_have_converged),
        cmocka_unit_test(too_few_iterations_have_not),
        cmocka_unit_test(what_is_left_to_a_method_is_told),
        cmocka_unit_test(what_iterative_sharpens_tells_its_choice_too),
        cmocka_unit_test(a_method_without_choices_tells_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
