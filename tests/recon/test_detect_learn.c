/* SPDX-License-Identifier: MIT */
#include "tests/recon/near.h"

#include <stdlib.h>
#include <string.h>

#include "recon/detection/detect_learn.h"
#include "tests/recon/reference.h"

enum { NX = 160, NZ = 200, CELLS = NX * NZ };

#define STEP_M 0.02

/* Ranges of 0.5 to 4.8 m from the array. */
static const struct grid grid = {{-1.59, 0, 0.5}, {STEP_M, STEP_M, STEP_M}, {NX, 1, NZ}};

static const struct cfar_config usual = {.kind = CFAR_AVERAGING,
                                         .false_alarm_rate = 1e-3,
                                         .n = {NX, 1, NZ},
                                         .pitch = {1, 1, 1},
                                         .guard = {1, 0, 1},
                                         .training = {3, 0, 4}};

static struct cfar *cfar_new(void)
{
    struct cfar *c = NULL;
    assert_int_equal(cfar_create(&c, &usual), 0);
    return c;
}

static double range_m(size_t cell)
{
    return hypot(grid.origin_m[0] + STEP_M * (double)(cell % NX),
                 grid.origin_m[2] + STEP_M * (double)(cell / NX));
}

/* x^spikes, x exponential of mean 1: more than t^spikes with the probability exp(-t). */
static float *noise(unsigned long long seed, double spikes)
{
    float *image = malloc(CELLS * sizeof *image);
    assert_non_null(image);
    for (size_t i = 0; i < CELLS; i++)
        image[i] = (float)pow(-log(reference_random(&seed)), spikes);
    return image;
}

/* Straight ahead, with spots of its sidelobes as far away as itself: one cell in 37 of
 * what is within 0.25 m. */
static void add_object(float *image, double at_m, double power)
{
    for (size_t i = 0; i < CELLS; i++)
        if (i % 37 == 0 && fabs(range_m(i) - at_m) < 0.25)
            image[i] = (float)(power / 40.0);
    image[(size_t)((at_m - grid.origin_m[2]) / STEP_M) * NX + NX / 2] = (float)power;
}

/* Noise of exponential powers: shape 1, no other tail, and so the factor of Finn and
 * Johnson, n (rate^(-1/n) - 1). */
static void expect_plain_noise(struct cfar *c)
{
    static const size_t n = 60;
    assert_true(cfar_has_learnt(c));
    assert_near(cfar_noise(c)->shape, 1.0, 0.05);
    assert_false(cfar_noise(c)->heavy);
    double factor = (double)n * (pow(1e-3, -1.0 / (double)n) - 1.0);
    assert_near(cfar_factor(c, n) / factor, 1.0, 0.1);
}

static void expect_same(const struct cfar_noise *a, const struct cfar_noise *b)
{
    assert_near(a->shape, b->shape, 0.0);
    assert_int_equal(a->heavy, b->heavy);
    if (a->heavy) {
        assert_near(a->from, b->from, 0.0);
        assert_near(a->scale, b->scale, 0.0);
        assert_near(a->index, b->index, 0.0);
    }
}

/* As if there were nothing but noise in it. */
static void expect_learnt_whole(const float *image)
{
    struct cfar *c = cfar_new(), *all = cfar_new();
    assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
    cfar_learn(all, image);
    expect_same(cfar_noise(c), cfar_noise(all));
    cfar_destroy(all);
    cfar_destroy(c);
}

static void noise_alone_is_learnt(void **state)
{
    (void)state;
    float *image = noise(1, 1.0);
    struct cfar *c = cfar_new();
    assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
    expect_plain_noise(c);
    expect_learnt_whole(image);
    cfar_destroy(c);
    free(image);
}

/* Near and far, alone and with others. */
static void objects_and_their_sidelobes_are_no_noise(void **state)
{
    (void)state;
    static const double at_m[3] = {2.8, 1.8, 3.8};
    for (int n = 1; n <= 3; n++) {
        float *image = noise(2, 1.0);
        struct cfar *c = cfar_new(), *all = cfar_new();
        for (int i = 0; i < n; i++)
            add_object(image, at_m[i], 1e5 / (1 + i));
        cfar_learn(all, image);
        assert_true(cfar_noise(all)->heavy);
        assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
        expect_plain_noise(c);
        cfar_destroy(all);
        cfar_destroy(c);
        free(image);
    }
}

/* A body 2.5 m deep, each fifth of it half as bright as the one before: no rings tell it
 * from clutter. */
static void add_body(float *image, bool *known)
{
    for (size_t i = 0; i < CELLS; i++) {
        size_t row = (i / NX - 40) / 25;
        double x_m = grid.origin_m[0] + STEP_M * (double)(i % NX);
        bool body = i / NX >= 40 && row < 5 && fabs(x_m) < 0.15;
        known[i] = body;
        if (body && i % 3 == 0)
            image[i] = (float)(4e3 * pow(2.0, -(double)row));
    }
}

/* He hides no tail: what is as far away as he is stays noise. */
static void who_is_known_is_no_noise(void **state)
{
    (void)state;
    float *image = noise(4, 1.0), *rest = noise(4, 1.0);
    bool *known = calloc(CELLS, sizeof *known);
    struct cfar *c = cfar_new(), *all = cfar_new(), *beside = cfar_new();

    assert_non_null(known);
    add_body(image, known);
    cfar_learn(all, image);
    assert_true(cfar_noise(all)->heavy);
    expect_learnt_whole(image); /* where nobody knows of him */
    assert_int_equal(detect_learn(c, &grid, image, known), 0);
    expect_plain_noise(c);

    for (size_t i = 0; i < CELLS; i++) {
        if (i % 37 == 0)
            image[i] = rest[i] = 40.0f; /* clutter, in front of him, too */
        rest[i] = known[i] ? 0.0f : rest[i];
    }
    cfar_destroy(c);
    c = cfar_new();
    assert_int_equal(detect_learn(c, &grid, image, known), 0);
    cfar_learn(beside, rest);
    assert_true(cfar_noise(c)->heavy);
    expect_same(cfar_noise(c), cfar_noise(beside));
    cfar_destroy(c);
    cfar_destroy(all);
    cfar_destroy(beside);
    free(known);
    free(rest);
    free(image);
}

/* Four alike are clutter, and so is one that is 6 times as bright as the next. */
static void the_brightest_of_many_are_noise(void **state)
{
    (void)state;
    float *image = noise(3, 1.0);
    for (int i = 0; i < 4; i++)
        add_object(image, 1.0 + 0.9 * i, 1e5);
    expect_learnt_whole(image);
    free(image);
    image = noise(3, 1.0);
    for (int i = 0; i < 4; i++)
        add_object(image, 1.0 + 0.9 * i, 1e5 * pow(6.0, -i));
    expect_learnt_whole(image);
    free(image);
}

/* Spiky clutter, P(x > t) = exp(-t^(1/3)): the tail that is learnt holds its rate in
 * other images of it. */
static void clutter_is_learnt_with_its_tail(void **state)
{
    (void)state;
    float *image = noise(4, 3.0);
    struct cfar *c = cfar_new();
    size_t alarms = 0;
    expect_learnt_whole(image);
    assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
    free(image);
    image = noise(5, 3.0);
    for (size_t i = 0; i < CELLS; i++)
        alarms += (double)image[i] > cfar_at(c, image, i).threshold;
    assert_in_range(alarms, (size_t)(0.5e-3 * CELLS), (size_t)(2e-3 * CELLS));
    cfar_destroy(c);
    free(image);
}

/* An object fills most of what was imaged: better than nothing, not than what is known.
 */
static void what_is_left_may_be_too_little(void **state)
{
    (void)state;
    float *image = noise(6, 1.0), *plain = noise(7, 1.0);
    struct cfar *c = cfar_new();
    add_object(image, 3.0, 1e5);
    for (size_t i = 0; i < CELLS; i++)
        if (fabs(range_m(i) - 3.0) > (i % 10 ? 0.3 : 0.5))
            image[i] = 0.0f;
    assert_int_equal(detect_learn(c, &grid, plain, NULL), 0);
    const struct cfar_noise before = *cfar_noise(c);
    assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
    expect_same(cfar_noise(c), &before);
    expect_plain_noise(c);
    cfar_destroy(c);
    expect_learnt_whole(image);
    free(plain);
    free(image);
}

/* One cell in seven of what lies so far away. */
static void add_shell(float *image, double near_m, double far_m, double power)
{
    for (size_t i = 0; i < CELLS; i++)
        if (i % 7 == 0 && range_m(i) >= near_m && range_m(i) < far_m)
            image[i] = (float)power;
}

/* Seven bins of 0.05 m on either side of the object's, which is the one from 2.8 m. */
static void the_ring_of_an_object_ends_a_third_of_a_metre_from_it(void **state)
{
    (void)state;
    static const double shell_m[2][2] = {{2.45, 3.15}, {2.40, 3.2}};
    for (int outside = 0; outside < 2; outside++)
        for (int far = 0; far < 2; far++) {
            float *image = noise(8, 1.0);
            struct cfar *c = cfar_new();
            add_object(image, 2.82, 1e5);
            add_shell(image, shell_m[outside][far], shell_m[outside][far] + 0.05, 2e3);
            assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
            if (outside)
                assert_true(cfar_noise(c)->heavy);
            else
                expect_plain_noise(c);
            cfar_destroy(c);
            free(image);
        }
}

static void leave_between(float *image, double near_m, double far_m)
{
    for (size_t i = 0; i < CELLS; i++)
        if (range_m(i) < near_m || range_m(i) >= far_m)
            image[i] = 0.0f;
}

/* Noise is learnt first, then what a narrow gate leaves of an image of other noise. */
static void expect_gate(double near_m, double far_m, double object, bool learnt)
{
    float *plain = noise(9, 1.0), *image = noise(10, 2.0);
    struct cfar *c = cfar_new();
    if (object > 0.0)
        add_object(image, 2.82, object);
    leave_between(image, near_m, far_m);
    assert_int_equal(detect_learn(c, &grid, plain, NULL), 0);
    const struct cfar_noise before = *cfar_noise(c);
    assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
    if (learnt)
        assert_true(cfar_noise(c)->shape != before.shape);
    else
        expect_same(cfar_noise(c), &before);
    cfar_destroy(c);
    free(image);
    free(plain);
}

static void an_object_that_fills_the_gate_is_not_learnt(void **state)
{
    (void)state;
    expect_gate(2.5, 3.15, 1e5, false);
}

/* Its three brightest and their rings are all there is, and they are alike. */
static void noise_in_a_narrow_gate_is_learnt(void **state)
{
    (void)state;
    expect_gate(2.2, 3.2, 0.0, true);
}

static void an_empty_image_teaches_nothing(void **state)
{
    (void)state;
    float *image = calloc(CELLS, sizeof *image);
    struct cfar *c = cfar_new();
    assert_non_null(image);
    assert_int_equal(detect_learn(c, &grid, image, NULL), 0);
    assert_near(cfar_noise(c)->shape, 1.0, 0.0);
    assert_false(cfar_noise(c)->heavy);
    cfar_destroy(c);
    free(image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_alone_is_learnt),
        cmocka_unit_test(objects_and_their_sidelobes_are_no_noise),
        cmocka_unit_test(who_is_known_is_no_noise),
        cmocka_unit_test(the_brightest_of_many_are_noise),
        cmocka_unit_test(clutter_is_learnt_with_its_tail),
        cmocka_unit_test(what_is_left_may_be_too_little),
        cmocka_unit_test(the_ring_of_an_object_ends_a_third_of_a_metre_from_it),
        cmocka_unit_test(an_object_that_fills_the_gate_is_not_learnt),
        cmocka_unit_test(noise_in_a_narrow_gate_is_learnt),
        cmocka_unit_test(an_empty_image_teaches_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
