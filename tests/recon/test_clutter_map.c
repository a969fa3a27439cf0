/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "recon/static_array/clutter_map.h"
#include "tests/nodes/near.h"

enum { NX = 60, NZ = 60, CELLS = NX * NZ };

#define MS        1000000LL
#define WINDOW_NS (200 * MS)

static const struct grid grid = {{-1.5, 0, 0.5}, {0.05, 0.1, 0.05}, {NX, 1, NZ}};

struct rig {
    struct clutter_map *map;
    struct mount mount;
    struct ego_path path; /* 1 m/s forward from 0 to 1 s */
    float image[CELLS];
};

static int setup(void **state)
{
    static const double origin_m[3] = {3.6, 0, 0.4}, left[3] = {0, 1, 0},
                        up[3] = {0, 0, 1};
    const struct ego_motion motion = {.speed_m_s = 1.0};
    struct rig *r = calloc(1, sizeof *r);

    if (!r || clutter_map_create(&r->map, &grid, WINDOW_NS))
        return -1;
    mount_create(&r->mount, origin_m, left, up);
    for (int k = 0; k <= 20; k++)
        if (ego_path_add(&r->path, k * 50 * MS, &motion))
            return -1;
    *state = r;
    return 0;
}

static int teardown(void **state)
{
    struct rig *r = *state;

    clutter_map_destroy(r->map);
    free(r);
    return 0;
}

static float *at(struct rig *r, double x_m, double z_m)
{
    size_t x = (size_t)lround((x_m - grid.origin_m[0]) / grid.step_m[0]);
    size_t z = (size_t)lround((z_m - grid.origin_m[2]) / grid.step_m[2]);

    return &r->image[z * NX + x];
}

/* An image of noise of power 1 with two bright places. */
static void image(struct rig *r, int64_t stamp_ns, double x_m, double z_m,
                  double other_x_m)
{
    for (int i = 0; i < CELLS; i++)
        r->image[i] = 1.0f;
    *at(r, x_m, z_m) = 100.0f;
    *at(r, other_x_m, 1.0) = 100.0f;
    clutter_map_mute(r->map, &r->path, &r->mount, stamp_ns, 1.0, r->image);
}

/* What stands comes nearer by what the vehicle drives. */
static void what_stands_over_ground_goes_and_what_moves_stays(void **state)
{
    struct rig *r = *state;

    image(r, 0, 0.5, 2.5, -1.0);
    assert_near(*at(r, 0.5, 2.5), 100.0, 0.0); /* nothing was seen before */
    image(r, 500 * MS, 0.5, 2.0, -0.4);
    assert_near(*at(r, 0.5, 2.0), 0.0, 0.0);
    assert_near(*at(r, -0.4, 1.0), 100.0, 0.0);
    assert_near(*at(r, 1.2, 3.0), 1.0, 0.0); /* noise is no clutter */
    image(r, 900 * MS, 0.5, 1.6, 0.2);
    assert_near(*at(r, 0.5, 1.6), 0.0, 0.0);
    assert_near(*at(r, 0.2, 1.0), 100.0, 0.0);
}

/* Within 0.15 m of depth and 0.08 m aside it is the same thing, farther off it is not. */
static void it_goes_where_it_is_a_little_off_too(void **state)
{
    struct rig *r = *state;

    image(r, 0, 0.5, 2.5, -1.0);
    image(r, 500 * MS, 0.55, 2.1, -0.4);
    assert_near(*at(r, 0.55, 2.1), 0.0, 0.0);
    clutter_map_reset(r->map);
    image(r, 0, 0.5, 2.5, -1.0);
    image(r, 500 * MS, 0.65, 2.0, -0.4);
    assert_near(*at(r, 0.65, 2.0), 100.0, 0.0);
}

static void what_appears_before_clutter_is_seen(void **state)
{
    struct rig *r = *state;

    image(r, 0, 0.5, 2.5, -1.0);
    for (int i = 0; i < CELLS; i++)
        r->image[i] = 1.0f;
    *at(r, 0.5, 2.0) = 1100.0f; /* over ten times as bright as before */
    *at(r, 0.45, 2.0) = 900.0f;
    clutter_map_mute(r->map, &r->path, &r->mount, 500 * MS, 1.0, r->image);
    assert_near(*at(r, 0.5, 2.0), 1100.0, 0.0);
    assert_near(*at(r, 0.45, 2.0), 900.0, 0.0); /* a part of it */
}

/* Images of the same pings, of unknown motion, from before, or after a reset. */
static void what_says_nothing_about_it_is_not_held_against_it(void **state)
{
    struct rig *r = *state;

    image(r, 0, 0.5, 2.5, -1.0);
    image(r, WINDOW_NS - 50 * MS, 0.5, 2.35, -0.4);
    assert_near(*at(r, 0.5, 2.35), 100.0, 0.0);
    image(r, WINDOW_NS, 0.5, 2.3, -0.4);
    assert_near(*at(r, 0.5, 2.3), 0.0, 0.0);
    clutter_map_reset(r->map);
    image(r, 500 * MS, 0.5, 2.0, -0.4);
    assert_near(*at(r, 0.5, 2.0), 100.0, 0.0);
    image(r, 100 * MS, 0.5, 2.4, -0.4); /* time went back */
    assert_near(*at(r, 0.5, 2.4), 100.0, 0.0);
    image(r, 5000 * MS, 0.5, 2.4, -0.4); /* the path has ended */
    assert_near(*at(r, 0.5, 2.4), 100.0, 0.0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_stands_over_ground_goes_and_what_moves_stays),
        TEST(it_goes_where_it_is_a_little_off_too),
        TEST(what_appears_before_clutter_is_seen),
        TEST(what_says_nothing_about_it_is_not_held_against_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
