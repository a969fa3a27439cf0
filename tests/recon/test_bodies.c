/* SPDX-License-Identifier: MIT */
/* Images of 5 cm voxels: Gaussian bodies over nothing. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "recon/static_array/bodies.h"
#include "tests/nodes/near.h"

enum { N = 40, VOXELS = N * N };

static const struct grid grid = {
    .origin_m = {0, 0, 0}, .step_m = {0.05, 0.05, 0.05}, .n = {N, 1, N}};

struct rig {
    struct bodies *bodies;
    float image[VOXELS], left[VOXELS];
};

static int setup(void **state)
{
    static struct rig rig;

    memset(&rig, 0, sizeof rig);
    *state = &rig;
    return bodies_create(&rig.bodies, &grid);
}

static int teardown(void **state)
{
    bodies_destroy(((struct rig *)*state)->bodies);
    return 0;
}

static void add(struct rig *r, double x_m, double z_m, double power)
{
    for (int v = 0; v < VOXELS; v++) {
        double dx = 0.05 * (v % N) - x_m, dz = 0.05 * (v / N) - z_m;
        r->image[v] += (float)(power * exp(-0.5 * (dx * dx + dz * dz) / 0.01));
    }
}

/* All but what is to the right of a line goes. */
static void take_up_to(struct rig *r, double x_m)
{
    for (int v = 0; v < VOXELS; v++)
        r->left[v] = 0.05 * (v % N) > x_m ? r->image[v] : 0.0f;
    bodies_restore(r->bodies, r->image, 4.0f, r->left);
}

static size_t brightest(const float *v)
{
    size_t best = 0;

    for (size_t i = 0; i < VOXELS; i++)
        best = v[i] > v[best] ? i : best;
    return best;
}

/* Left is what is more than 0.15 m ahead, of exp(-0.5 1.5^2) of the power. */
static void what_is_left_of_a_body_brings_all_of_it_back_as_bright_as_it_was(void **state)
{
    struct rig *r = *state;

    add(r, 1.0, 1.0, 100.0);
    take_up_to(r, 1.125);
    assert_int_equal(brightest(r->left), 20 * N + 20);
    assert_near(r->left[20 * N + 20], 100.0 * exp(-1.125), 1e-3);
    assert_near(r->left[20 * N + 17], r->left[20 * N + 23], 1e-3);
}

static void a_body_of_several_bright_places_comes_back_together(void **state)
{
    struct rig *r = *state;

    r->image[20 * N + 20] = 100.0f;
    r->image[20 * N + 23] = 50.0f;
    take_up_to(r, 1.1);
    assert_near(r->left[20 * N + 20], 50.0, 1e-3);
    assert_near(r->left[20 * N + 23], 25.0, 1e-3);
}

static void a_trace_of_something_bright_does_not_bring_it_back(void **state)
{
    struct rig *r = *state;

    add(r, 1.0, 1.0, 100.0);
    take_up_to(r, 1.225); /* 0.25 m off: 4 %, and that is too faint */
    assert_near(r->left[20 * N + 20], 0.0, 0.0);
    assert_near(r->left[20 * N + 25], r->image[20 * N + 25], 0.0);
}

static void what_stands_apart_stays_away(void **state)
{
    struct rig *r = *state;

    add(r, 0.4, 1.0, 1000.0);
    add(r, 1.4, 1.0, 100.0);
    take_up_to(r, 1.475);
    assert_near(r->left[20 * N + 8], 0.0, 0.0);
    assert_int_equal(brightest(r->left), 20 * N + 28);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_left_of_a_body_brings_all_of_it_back_as_bright_as_it_was),
        TEST(a_body_of_several_bright_places_comes_back_together),
        TEST(a_trace_of_something_bright_does_not_bring_it_back),
        TEST(what_stands_apart_stays_away),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
