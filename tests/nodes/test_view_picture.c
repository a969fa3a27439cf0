/* SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include <errno.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "nodes/view/picture.h"

#define NX 5
#define NY 3
#define NZ 37 /* not a multiple of any vector's length */

static const struct grid grid = {
    .origin_m = {0.0, 0.0, 2.0}, .step_m = {0.1, 0.1, 0.1}, .n = {NX, NY, NZ}};

static size_t at(size_t x, size_t y, size_t z)
{
    return (z * NY + y) * NX + x;
}

static void a_level_is_a_quarter_of_a_decibel(void **state)
{
    static float x[NX * NY * NZ];
    struct picture p;

    (void)state;
    for (size_t i = 0; i < NX * NY * NZ; i++) /* 0 to -66 dB of an odd peak */
        x[i] = (float)(7.3e-5 * pow(10.0, -0.012 * (double)i));
    assert_int_equal(picture_create(&p, &grid, x), 0);
    assert_true(fabs(p.peak - 7.3e-5) < 1e-11);
    for (size_t i = 0; i < NX * NY * NZ; i++) {
        double exact = 255.0 - 0.12 * (double)i / PICTURE_STEP_DB;
        if (exact < 1.0)
            assert_true(p.level[i] <= 1);
        else
            assert_true(fabs((double)p.level[i] - exact) <= 0.51);
    }
    assert_int_equal(p.level[0], 255);
    picture_clear(&p);
}

static void brighter_is_never_a_lower_level(void **state)
{
    static float x[NX * NY * NZ];
    struct picture p;

    (void)state;
    for (size_t i = 0; i < NX * NY * NZ; i++)
        x[i] = 1.0f + (float)i * 3.1f / (NX * NY * NZ); /* over two octaves' ends */
    assert_int_equal(picture_create(&p, &grid, x), 0);
    for (size_t i = 1; i < NX * NY * NZ; i++)
        assert_true(p.level[i] >= p.level[i - 1]);
    picture_clear(&p);
}

static void what_is_no_intensity_is_dark(void **state)
{
    static float x[NX * NY * NZ];
    struct picture p;

    (void)state;
    x[at(1, 1, 1)] = NAN;
    x[at(2, 1, 1)] = INFINITY;
    x[at(3, 1, 1)] = -5.0f;
    x[at(4, 2, 30)] = 2.0f;
    x[at(0, 2, 30)] = FLT_MIN / 4.0f;
    assert_int_equal(picture_create(&p, &grid, x), 0);
    for (size_t i = 0; i < NX * NY * NZ; i++)
        assert_int_equal(p.level[i], i == at(4, 2, 30) ? 255 : 0);
    picture_clear(&p);
}

static void darkness_is_a_picture_too(void **state)
{
    static float x[NX * NY * NZ];
    struct grid empty = grid;
    struct picture p;

    (void)state;
    assert_int_equal(picture_create(&p, &grid, x), 0);
    assert_true(p.peak == 0.0);
    for (size_t i = 0; i < NX * NY * NZ; i++)
        assert_int_equal(p.level[i], 0);
    picture_clear(&p);
    empty.n[1] = 0;
    assert_int_equal(picture_create(&p, &empty, x), -EINVAL);
}

/* Powers of noise are exponential: the largest of n is about ln n / ln 2 medians, 9.6 dB
 * of 555; full scale is 30 dB above the median, and with 13 dB for the largest 17 dB are
 * left, 68 levels.  A thing 40 dB above the median is full scale itself. */
static void noise_is_not_drawn_as_bright_as_a_thing(void **state)
{
    static float x[NX * NY * NZ];
    unsigned seed = 3;
    struct picture p;

    (void)state;
    for (size_t i = 0; i < NX * NY * NZ; i++) {
        seed = seed * 1664525u + 1013904223u;
        x[i] = -logf(((float)(seed >> 8) + 1.0f) / 16777217.0f);
    }
    assert_int_equal(picture_create(&p, &grid, x), 0);
    for (size_t i = 0; i < NX * NY * NZ; i++)
        assert_true(p.level[i] < 255 - 68);
    assert_true(fabs(p.noise - M_LN2) < 0.15 * M_LN2); /* the median of so few */
    assert_true(p.peak == 1000.0 * p.noise && p.brightest < 0.1 * p.peak);
    picture_clear(&p);
    x[at(2, 1, 20)] = 1e4f * (float)M_LN2;
    assert_int_equal(picture_create(&p, &grid, x), 0);
    assert_int_equal(p.level[at(2, 1, 20)], 255);
    assert_true(p.brightest == p.peak && p.peak > 9000.0 * p.noise);
    picture_clear(&p);
}

/* Two voxels: the front view has both, each side has the greater of what is in line. */
static void a_projection_is_the_maximum_along_its_axis(void **state)
{
    static float x[NX * NY * NZ];
    struct picture p;
    size_t n[2];

    (void)state;
    x[at(1, 2, 10)] = 1.0f;
    x[at(3, 2, 10)] = 0.1f;  /* -10 dB: 40 levels */
    x[at(3, 0, 36)] = 0.01f; /* -20 dB: 80 levels */
    assert_int_equal(picture_create(&p, &grid, x), 0);
    assert_int_equal(picture_side_size(&p, PICTURE_XY, n), NX * NY);
    assert_int_equal(n[0], NX);
    for (size_t y = 0; y < NY; y++)
        for (size_t u = 0; u < NX; u++)
            assert_int_equal(p.projection[PICTURE_XY][y * NX + u],
                             u == 1 && y == 2   ? 255
                             : u == 3 && y == 2 ? 215
                             : u == 3 && y == 0 ? 175
                                                : 0);
    assert_int_equal(picture_side_size(&p, PICTURE_XZ, n), NX * NZ);
    assert_int_equal(p.projection[PICTURE_XZ][10 * NX + 1], 255);
    assert_int_equal(p.projection[PICTURE_XZ][10 * NX + 3], 215);
    assert_int_equal(p.projection[PICTURE_XZ][36 * NX + 3], 175);
    assert_int_equal(picture_side_size(&p, PICTURE_YZ, n), NY * NZ);
    assert_int_equal(n[1], NZ);
    assert_int_equal(p.projection[PICTURE_YZ][10 * NY + 2], 255);
    assert_int_equal(p.projection[PICTURE_YZ][36 * NY + 0], 175);
    assert_int_equal(p.projection[PICTURE_YZ][36 * NY + 2], 0);
    assert_int_equal(picture_slice(&p, 10)[2 * NX + 3], 215);
    assert_int_equal(picture_slice(&p, 36)[2 * NX + 3], 0);
    picture_clear(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_level_is_a_quarter_of_a_decibel),
        cmocka_unit_test(brighter_is_never_a_lower_level),
        cmocka_unit_test(what_is_no_intensity_is_dark),
        cmocka_unit_test(darkness_is_a_picture_too),
        cmocka_unit_test(noise_is_not_drawn_as_bright_as_a_thing),
        cmocka_unit_test(a_projection_is_the_maximum_along_its_axis),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
