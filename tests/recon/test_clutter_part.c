/* SPDX-License-Identifier: MIT */
/* Images of noise 1 with one bright voxel, of a vehicle that stands. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "recon/static_array/clutter_map.h"

#define WINDOW_NS 400000000LL
#define PING_NS   25000000LL

enum { N = 20, VOXELS = N * N, MIDDLE = N * N / 2 + N / 2 };

struct rig {
    struct clutter_map *map;
    struct mount mount;
    struct ego_path path;
    int64_t now_ns;
    float image[VOXELS];
};

static int setup(void **state)
{
    static const struct grid grid = {
        .n = {N, 1, N}, .origin_m = {-1, 0, 2}, .step_m = {0.1, 0.1, 0.1}};
    static const double origin_m[3] = {3, 0, 0.4}, x_axis[3] = {0, 1, 0},
                        y_axis[3] = {0, 0, 1};
    static struct rig rig;

    rig = (struct rig){.now_ns = WINDOW_NS};
    mount_create(&rig.mount, origin_m, x_axis, y_axis);
    *state = &rig;
    return clutter_map_create(&rig.map, &grid, WINDOW_NS);
}

static int teardown(void **state)
{
    clutter_map_destroy(((struct rig *)*state)->map);
    return 0;
}

/* A ping later: what is left of a voxel. */
static float image(struct rig *r, size_t at, float power, double part)
{
    static const struct ego_motion stands = {0.0, 0.0};

    r->now_ns += PING_NS;
    ego_path_add(&r->path, r->now_ns, &stands);
    for (size_t i = 0; i < VOXELS; i++)
        r->image[i] = 1.0f;
    r->image[at] = power;
    clutter_map_mute(r->map, &r->path, &r->mount, r->now_ns, part, r->image);
    return r->image[at];
}

static void see(struct rig *r, size_t at, float power, int64_t for_ns)
{
    for (int64_t t_ns = 0; t_ns < for_ns; t_ns += PING_NS)
        image(r, at, power, 1.0);
}

static void what_was_there_a_window_ago_is_muted(void **state)
{
    struct rig *r = *state;

    see(r, MIDDLE, 100.0f, WINDOW_NS);
    assert_true(image(r, MIDDLE, 100.0f, 1.0) == 0.0f);
    assert_true(image(r, MIDDLE, 990.0f, 1.0) == 0.0f);
    assert_true(image(r, MIDDLE, 1010.0f, 1.0) == 1010.0f); /* ten times */
    assert_true(image(r, MIDDLE + 1, 100.0f, 1.0) == 0.0f); /* beside it */
    assert_true(image(r, MIDDLE + 5, 100.0f, 1.0) == 100.0f);
}

/* What is held against it is a quarter of a window older than it has to be, at most. */
static void what_has_left_is_forgotten_soon(void **state)
{
    struct rig *r = *state;

    see(r, MIDDLE, 100.0f, WINDOW_NS);
    see(r, 0, 1.0f, WINDOW_NS * 5 / 4 + PING_NS);
    assert_true(image(r, MIDDLE, 100.0f, 1.0) == 100.0f);
}

static void clutter_counts_by_the_part_without_a_background(void **state)
{
    struct rig *r = *state;

    see(r, MIDDLE, 100.0f, WINDOW_NS + PING_NS);
    assert_true(image(r, MIDDLE, 240.0f, 0.25) == 0.0f);
    assert_true(image(r, MIDDLE, 260.0f, 0.25) == 260.0f);
}

/* However long: only what had no background tells what stands there. */
static void an_image_with_a_background_in_it_tells_nothing_of_clutter(void **state)
{
    struct rig *r = *state;

    see(r, MIDDLE, 100.0f, WINDOW_NS);
    for (int i = 0; i < 100; i++)
        image(r, 0, 50.0f, 0.5);
    assert_true(image(r, 0, 50.0f, 1.0) == 50.0f);
    assert_true(image(r, MIDDLE, 100.0f, 1.0) == 0.0f);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_was_there_a_window_ago_is_muted),
        TEST(what_has_left_is_forgotten_soon),
        TEST(clutter_counts_by_the_part_without_a_background),
        TEST(an_image_with_a_background_in_it_tells_nothing_of_clutter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
